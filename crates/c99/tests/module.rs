//! A writer of modules.

/// Types of values.
pub(crate) const I32: u8 = 0x7f;
pub(crate) const I64: u8 = 0x7e;
pub(crate) const F32: u8 = 0x7d;
pub(crate) const F64: u8 = 0x7c;

/// A function that is exported under its name.
pub(crate) struct Function {
    pub(crate) name: &'static str,
    pub(crate) parameters: Vec<u8>,
    pub(crate) results: Vec<u8>,
    /// Local variables of whole numbers.
    pub(crate) locals: u8,
    /// Instructions, without the last `end`.
    pub(crate) body: Vec<u8>,
}

impl Function {
    pub(crate) fn new(name: &'static str, parameters: &[u8], results: &[u8], body: &[u8]) -> Self {
        Self { name, parameters: parameters.to_vec(), results: results.to_vec(), locals: 0, body: body.to_vec() }
    }
}

/// An unsigned number as WebAssembly writes it.
fn number(mut value: u32) -> Vec<u8> {
    let mut bytes = vec![];
    loop {
        let byte = (value & 0x7f) as u8;
        value >>= 7;
        if value == 0 {
            bytes.push(byte);
            return bytes;
        }
        bytes.push(byte | 0x80);
    }
}

/// The instruction for a constant.
pub(crate) fn constant(value: i32) -> Vec<u8> {
    let (mut bytes, mut rest) = (vec![0x41], value);
    loop {
        let byte = (rest & 0x7f) as u8;
        rest >>= 7;
        if (rest == 0 && byte & 0x40 == 0) || (rest == -1 && byte & 0x40 != 0) {
            bytes.push(byte);
            return bytes;
        }
        bytes.push(byte | 0x80);
    }
}

fn list(items: &[Vec<u8>]) -> Vec<u8> {
    [number(items.len() as u32), items.concat()].concat()
}

fn section(id: u8, content: &[u8]) -> Vec<u8> {
    [vec![id], number(content.len() as u32), content.to_vec()].concat()
}

fn text(text: &str) -> Vec<u8> {
    [number(text.len() as u32), text.as_bytes().to_vec()].concat()
}

/// A module with a stack of so many bytes, 16 bytes of constants behind it, and the heap behind them. With an import the first function
/// is not its own.
pub(crate) fn module(functions: &[Function], stack: i32, import: Option<&str>) -> Vec<u8> {
    let types: Vec<_> = functions
        .iter()
        .map(|of| {
            [
                vec![0x60],
                number(of.parameters.len() as u32),
                of.parameters.clone(),
                number(of.results.len() as u32),
                of.results.clone(),
            ]
            .concat()
        })
        .collect();
    let imports: Vec<_> = import.iter().map(|name| [text("env"), text(name), vec![0, 0]].concat()).collect();
    let of_type: Vec<_> = (0..functions.len()).map(|at| number(at as u32)).collect();
    let globals = [
        [vec![I32, 1], constant(stack), vec![0x0b]].concat(),
        [vec![I32, 0], constant(stack + 16), vec![0x0b]].concat(),
    ];
    let mut exports: Vec<_> =
        functions.iter().enumerate().map(|(at, of)| [text(of.name), vec![0], number(at as u32)].concat()).collect();
    exports.push([text("__heap_base"), vec![3, 1]].concat());
    let bodies: Vec<_> = functions
        .iter()
        .map(|of| {
            let locals = if of.locals == 0 { vec![0] } else { vec![1, of.locals, I32] };
            let body = [locals, of.body.clone(), vec![0x0b]].concat();
            [number(body.len() as u32), body].concat()
        })
        .collect();
    let data = [[vec![0], constant(stack), vec![0x0b], number(16), (1..=16).collect()].concat()];
    [
        b"\0asm\x01\0\0\0".to_vec(),
        section(1, &list(&types)),
        if imports.is_empty() { vec![] } else { section(2, &list(&imports)) },
        section(3, &list(&of_type)),
        section(5, &[1, 0, 1]),
        section(6, &list(&globals)),
        section(7, &list(&exports)),
        section(10, &list(&bodies)),
        section(11, &list(&data)),
    ]
    .concat()
}
