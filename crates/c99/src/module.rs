//! What is read of a module.

use wasmparser::{
    DataKind, ExternalKind, FuncType, KnownCustom, Name, Operator, Parser, Payload, TypeRef, ValType, Validator,
    WasmFeatures,
};

use crate::error::Error;

/// The global variable of the stack pointer, by the convention of the linker.
pub(crate) const STACK_POINTER: u32 = 0;

/// A function with its instructions.
pub(crate) struct Function<'a> {
    /// Its parameters and result.
    pub(crate) signature: FuncType,
    /// Types of its parameters and local variables.
    pub(crate) locals: Vec<ValType>,
    /// Its instructions.
    pub(crate) body: Vec<Operator<'a>>,
    /// Its name by the linker.
    pub(crate) symbol: String,
    /// The name under which it can be called from outside.
    pub(crate) export: Option<String>,
}

/// A module.
pub(crate) struct Module<'a> {
    pub(crate) functions: Vec<Function<'a>>,
    /// Types by their index, for blocks.
    pub(crate) types: Vec<FuncType>,
    /// Constant bytes and their address.
    pub(crate) data: Vec<(u32, &'a [u8])>,
    /// Where the stack begins, which grows towards zero.
    pub(crate) stack: u32,
    /// First address behind stack and constants.
    pub(crate) heap: u32,
}

impl<'a> Module<'a> {
    /// Reads a module.
    pub(crate) fn read(bytes: &'a [u8]) -> Result<Self, Error> {
        Validator::new_with_features(features()).validate_all(bytes)?;
        let (mut types, mut of_type, mut data, mut globals, mut exports) = (vec![], vec![], vec![], vec![], vec![]);
        let (mut bodies, mut symbols) = (vec![], vec![]);
        for payload in Parser::new(0).parse_all(bytes) {
            match payload? {
                Payload::TypeSection(section) => {
                    types = section.into_iter_err_on_gc_types().collect::<Result<Vec<_>, _>>()?;
                }
                Payload::ImportSection(section) => {
                    if let Some(import) = section.into_imports().next() {
                        let import = import?;
                        let is_function = matches!(import.ty, TypeRef::Func(_));
                        return Err(Error::Import(format!("{}{}", import.name, if is_function { "()" } else { "" })));
                    }
                }
                Payload::FunctionSection(section) => of_type = section.into_iter().collect::<Result<Vec<_>, _>>()?,
                Payload::TableSection(_) | Payload::ElementSection(_) => {
                    // An empty table, which the linker may leave, calls nothing: `call_indirect` is not translated.
                }
                Payload::GlobalSection(section) => {
                    for global in section {
                        globals.push(constant(&global?.init_expr)?);
                    }
                }
                Payload::ExportSection(section) => exports = section.into_iter().collect::<Result<Vec<_>, _>>()?,
                Payload::StartSection { .. } => return Err(Error::Part("a start function")),
                Payload::DataSection(section) => {
                    for segment in section {
                        let segment = segment?;
                        let DataKind::Active { offset_expr, .. } = segment.kind else {
                            return Err(Error::Part("passive data"));
                        };
                        data.push((constant(&offset_expr)?, segment.data));
                    }
                }
                Payload::CodeSectionEntry(body) => bodies.push(body),
                Payload::CustomSection(section) => {
                    if let KnownCustom::Name(names) = section.as_known() {
                        for name in names {
                            if let Name::Function(names) = name? {
                                symbols = names.into_iter().collect::<Result<Vec<_>, _>>()?;
                            }
                        }
                    }
                }
                _ => {}
            }
        }
        let mut functions = Vec::with_capacity(bodies.len());
        for (index, (body, ty)) in bodies.into_iter().zip(of_type).enumerate() {
            let signature = types.get(ty as usize).ok_or(Error::Part("a function without a type"))?.clone();
            let mut locals = signature.params().to_vec();
            for group in body.get_locals_reader()? {
                let (count, ty) = group?;
                locals.extend(std::iter::repeat_n(ty, count as usize));
            }
            let body = body.get_operators_reader()?.into_iter().collect::<Result<Vec<_>, _>>()?;
            let symbol = symbols.iter().find(|name| name.index as usize == index);
            let export =
                exports.iter().find(|export| export.kind == ExternalKind::Func && export.index as usize == index);
            functions.push(Function {
                signature,
                locals,
                body,
                symbol: symbol.map_or_else(|| format!("function_{index}"), |symbol| symbol.name.to_owned()),
                export: export.map(|export| export.name.to_owned()),
            });
        }
        let global = |name: &str| {
            let export = exports.iter().find(|export| export.kind == ExternalKind::Global && export.name == name);
            export.and_then(|export| globals.get(export.index as usize)).copied()
        };
        let heap = global("__heap_base").ok_or(Error::Part("no \"__heap_base\""))?;
        let stack = globals.get(STACK_POINTER as usize).copied().ok_or(Error::Part("no stack pointer"))?;
        if data.iter().any(|(address, bytes)| *address < stack || address + bytes.len() as u32 > heap) {
            return Err(Error::Part("constants below its stack"));
        }
        Ok(Self { functions, types, data, stack, heap })
    }
}

/// What the compiler of Rust writes for this target.
fn features() -> WasmFeatures {
    WasmFeatures::WASM1
        | WasmFeatures::BULK_MEMORY
        | WasmFeatures::SIGN_EXTENSION
        | WasmFeatures::SATURATING_FLOAT_TO_INT
        | WasmFeatures::MULTI_VALUE
        | WasmFeatures::REFERENCE_TYPES
}

/// The value of a constant expression.
fn constant(expression: &wasmparser::ConstExpr<'_>) -> Result<u32, Error> {
    match expression.get_operators_reader().read()? {
        Operator::I32Const { value } => Ok(value.cast_unsigned()),
        _ => Err(Error::Part("a global variable that is not a whole number")),
    }
}
