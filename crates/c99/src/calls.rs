//! What each function needs, by itself and by those that it calls.

use wasmparser::Operator;

use crate::error::Error;
use crate::module::{Function, Module, STACK_POINTER};

/// What a function needs.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Needs {
    /// The linear memory.
    pub(crate) memory: bool,
    /// The stack pointer.
    pub(crate) stack: bool,
    /// Most stack that it and those that it calls use, bytes.
    pub(crate) stack_bytes: u32,
}

/// The needs of all functions, and the order in which each comes behind those that it calls.
pub(crate) struct Calls {
    pub(crate) needs: Vec<Needs>,
    pub(crate) order: Vec<usize>,
}

impl Calls {
    /// Follows the calls of a module.
    pub(crate) fn of(module: &Module<'_>) -> Result<Self, Error> {
        let mut walk = Walk { module, needs: vec![None; module.functions.len()], open: vec![], order: vec![] };
        for index in 0..module.functions.len() {
            walk.follow(index)?;
        }
        Ok(Self { needs: walk.needs.into_iter().flatten().collect(), order: walk.order })
    }
}

struct Walk<'m, 'a> {
    module: &'m Module<'a>,
    needs: Vec<Option<Needs>>,
    /// The functions on the way to this one.
    open: Vec<usize>,
    order: Vec<usize>,
}

impl Walk<'_, '_> {
    fn follow(&mut self, index: usize) -> Result<Needs, Error> {
        if let Some(needs) = self.needs[index] {
            return Ok(needs);
        }
        let function = &self.module.functions[index];
        if self.open.contains(&index) {
            return Err(Error::Recursion(function.symbol.clone()));
        }
        self.open.push(index);
        let mut needs = own(function)?;
        let mut below = 0;
        for operator in &function.body {
            if let Operator::Call { function_index } = operator {
                let called = self.follow(*function_index as usize)?;
                needs.memory |= called.memory;
                needs.stack |= called.stack;
                below = below.max(called.stack_bytes);
            }
        }
        needs.stack_bytes += below;
        self.open.pop();
        self.needs[index] = Some(needs);
        self.order.push(index);
        Ok(needs)
    }
}

/// What a function needs by itself. It takes its part of the stack once, by a subtraction from the stack pointer, and gives it back by the
/// sum; one that calls nothing may leave the stack pointer as it is, also in a local variable. Any other use of it is an error, as it would
/// leave the size of the stack unknown.
fn own(function: &Function<'_>) -> Result<Needs, Error> {
    use Operator as O;
    let other = || Error::StackPointer(function.symbol.clone());
    let mut needs = Needs::default();
    // The local variable that holds the stack pointer.
    let mut held = None;
    for (at, operator) in function.body.iter().enumerate() {
        let taken = || match function.body.get(at + 1..at + 3) {
            Some([O::I32Const { value }, O::I32Sub]) if *value > 0 => Ok(value.cast_unsigned()),
            _ => Err(other()),
        };
        let before = |count: usize| at.checked_sub(count).map_or(&[][..], |from| &function.body[from..at]);
        match operator {
            O::GlobalGet { global_index: STACK_POINTER } => {
                if needs.stack {
                    return Err(other());
                }
                needs.stack = true;
                match function.body.get(at + 1) {
                    Some(O::LocalSet { local_index }) => held = Some(*local_index),
                    _ => needs.stack_bytes = taken()?,
                }
            }
            O::LocalGet { local_index } if held == Some(*local_index) => {
                needs.stack_bytes = needs.stack_bytes.max(taken()?);
            }
            O::LocalSet { local_index }
                if held == Some(*local_index) && !matches!(before(1), [O::GlobalGet { .. }]) =>
            {
                held = None;
            }
            O::LocalTee { local_index } if held == Some(*local_index) => held = None,
            O::GlobalSet { global_index: STACK_POINTER } => {
                let takes =
                    matches!(before(4), [O::GlobalGet { .. }, O::I32Const { .. }, O::I32Sub, O::LocalTee { .. }]);
                let gives_back = match before(3) {
                    [O::LocalGet { .. }, O::I32Const { value }, O::I32Add] => {
                        value.cast_unsigned() == needs.stack_bytes
                    }
                    _ => false,
                };
                if !takes && !gives_back {
                    return Err(other());
                }
            }
            O::GlobalGet { .. } | O::GlobalSet { .. } => return Err(Error::Part("a global variable")),
            _ => needs.memory |= touches_memory(operator),
        }
    }
    Ok(needs)
}

/// Whether an instruction that is translated reads or writes the memory.
fn touches_memory(operator: &Operator<'_>) -> bool {
    use Operator as O;
    matches!(
        operator,
        O::I32Load { .. }
            | O::F32Load { .. }
            | O::I64Load { .. }
            | O::I32Load8U { .. }
            | O::I32Load8S { .. }
            | O::I32Load16U { .. }
            | O::I64Load8U { .. }
            | O::I64Load16U { .. }
            | O::I64Load32U { .. }
            | O::I32Store { .. }
            | O::F32Store { .. }
            | O::I64Store { .. }
            | O::I32Store8 { .. }
            | O::I32Store16 { .. }
            | O::I64Store8 { .. }
            | O::I64Store16 { .. }
            | O::I64Store32 { .. }
            | O::MemoryCopy { .. }
            | O::MemoryFill { .. }
    )
}
