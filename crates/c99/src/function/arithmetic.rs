//! Instructions that leave a value: constants, memory, arithmetic.

use wasmparser::{MemArg, Operator};

use super::Writer;
use crate::error::Error;
use crate::expression::{Binding, Type, Value};

impl Writer<'_, '_> {
    /// Constants, memory and arithmetic.
    pub(super) fn arithmetic(&mut self, operator: &Operator<'_>) -> Result<(), Error> {
        use Operator as O;
        use Type::{Long, Single, Word};
        match operator {
            O::I32Const { value } => self.push(Value::word(value.cast_unsigned())),
            O::I64Const { value } => self.push(Value::long(value.cast_unsigned())),
            O::F32Const { value } => self.push(Value::single(value.bits())),

            O::I32Load { memarg } => self.load(memarg, "u32_at", "u32_of_bytes", Word)?,
            O::F32Load { memarg } => self.load(memarg, "f32_at", "f32_of_bytes", Single)?,
            O::I64Load { memarg } if memarg.align >= 2 => self.load(memarg, "u64_at", "", Long)?,
            O::I64Load { memarg } => self.load(memarg, "", "u64_of_bytes", Long)?,
            O::I32Load8U { memarg } => self.load(memarg, "u8_at", "", Word)?,
            O::I32Load8S { memarg } => {
                self.load(memarg, "u8_at", "", Word)?;
                let byte = self.pop()?;
                self.push(Value::call("extend_8", &[&byte], Word));
            }
            O::I32Load16U { memarg } => self.load(memarg, "u16_at", "u16_at", Word)?,
            O::I64Load32U { memarg } => {
                self.load(memarg, "u32_at", "u32_of_bytes", Word)?;
                let word = self.pop()?;
                self.push(word.unary("(uint64_t)", Long));
            }
            O::I64Load16U { memarg } => {
                self.load(memarg, "u16_at", "u16_at", Word)?;
                let word = self.pop()?;
                self.push(word.unary("(uint64_t)", Long));
            }
            O::I64Load8U { memarg } => {
                self.load(memarg, "u8_at", "", Word)?;
                let word = self.pop()?;
                self.push(word.unary("(uint64_t)", Long));
            }
            O::I32Store { memarg } => self.store(memarg, "set_u32", "set_bytes_of_u32", "")?,
            O::F32Store { memarg } => self.store(memarg, "set_f32", "set_bytes_of_f32", "")?,
            O::I64Store { memarg } if memarg.align >= 2 => self.store(memarg, "set_u64", "", "")?,
            O::I64Store { memarg } => self.store(memarg, "", "set_bytes_of_u64", "")?,
            O::I32Store8 { memarg } => self.store(memarg, "set_u8", "", "")?,
            O::I32Store16 { memarg } => self.store(memarg, "set_u16", "set_u16", "")?,
            O::I64Store32 { memarg } => self.store(memarg, "set_u32", "set_bytes_of_u32", "(uint32_t)")?,
            O::I64Store16 { memarg } => self.store(memarg, "set_u16", "set_u16", "(uint32_t)")?,
            O::I64Store8 { memarg } => self.store(memarg, "set_u8", "", "(uint32_t)")?,

            O::I32Eqz | O::I64Eqz => {
                let value = self.pop()?;
                self.push(value.is_zero());
            }
            O::I32Eq | O::I64Eq | O::F32Eq => self.comparison("==")?,
            O::I32Ne | O::I64Ne | O::F32Ne => self.comparison("!=")?,
            O::I32LtU | O::I64LtU | O::F32Lt => self.comparison("<")?,
            O::I32GtU | O::I64GtU | O::F32Gt => self.comparison(">")?,
            O::I32LeU | O::I64LeU | O::F32Le => self.comparison("<=")?,
            O::I32GeU | O::I64GeU | O::F32Ge => self.comparison(">=")?,
            O::I32LtS => self.signed_comparison("<")?,
            O::I32GtS => self.signed_comparison(">")?,
            O::I32LeS => self.signed_comparison("<=")?,
            O::I32GeS => self.signed_comparison(">=")?,

            O::I32Add => self.sum()?,
            O::I64Add | O::F32Add => self.binary("+", Binding::Sum)?,
            O::I32Sub | O::I64Sub | O::F32Sub => self.binary("-", Binding::Sum)?,
            O::I32Mul | O::I64Mul | O::F32Mul => self.binary("*", Binding::Product)?,
            O::F32Div | O::I32DivU | O::I64DivU => self.binary("/", Binding::Product)?,
            O::I32RemU | O::I64RemU => self.binary("%", Binding::Product)?,
            O::I32And => self.logic("&", "&&")?,
            O::I32Or => self.logic("|", "||")?,
            O::I64And => self.binary("&", Binding::Bits)?,
            O::I64Or => self.binary("|", Binding::Bits)?,
            O::I32Xor | O::I64Xor => self.binary("^", Binding::Bits)?,
            O::I32Shl => self.shift("<<", 32)?,
            O::I64Shl => self.shift("<<", 64)?,
            O::I32ShrU => self.shift(">>", 32)?,
            O::I64ShrU => self.shift(">>", 64)?,
            O::I32ShrS => self.of_two("shift_signed", Word)?,
            O::I32Rotl => self.of_two("rotate", Word)?,
            O::I32Clz => self.of_one("leading_zeros", Word)?,

            O::F32Abs => self.of_one("fabsf", Single)?,
            O::F32Neg => {
                let value = self.pop()?;
                self.push(value.unary("-", Single));
            }
            O::F32Sqrt => self.of_one("sqrtf", Single)?,
            O::F32Floor => self.of_one("floorf", Single)?,
            O::F32Ceil => self.of_one("ceilf", Single)?,
            O::F32Trunc => self.of_one("truncf", Single)?,
            O::F32Min => self.of_two("smaller", Single)?,
            O::F32Max => self.of_two("larger", Single)?,
            O::F32Copysign => self.of_two("copysignf", Single)?,
            O::F32ConvertI32U => self.cast("(float)", Single)?,
            O::F32ConvertI32S => {
                let value = self.pop()?;
                // In one expression: a variable of its own would have lost the sign.
                self.push(value.unary("(int32_t)", Word).unary("(float)", Single));
            }
            O::I32TruncSatF32U => self.of_one("whole", Word)?,
            O::I32TruncSatF32S => self.of_one("whole_signed", Word)?,
            O::I32WrapI64 => self.cast("(uint32_t)", Word)?,
            O::I64ExtendI32U => self.cast("(uint64_t)", Long)?,
            O::I32Extend8S => self.of_one("extend_8", Word)?,
            O::I32ReinterpretF32 => self.of_one("bits", Word)?,
            O::F32ReinterpretI32 => self.of_one("single", Single)?,
            _ => return Err(self.not_translated(operator)),
        }
        Ok(())
    }

    fn load(&mut self, at: &MemArg, aligned: &str, bytes: &str, ty: Type) -> Result<(), Error> {
        let address = self.pop()?;
        let is_aligned = at.align == at.max_align || bytes.is_empty();
        self.push(Value::load(if is_aligned { aligned } else { bytes }, &address, at.offset, ty));
        Ok(())
    }

    fn store(&mut self, at: &MemArg, aligned: &str, bytes: &str, cast: &str) -> Result<(), Error> {
        let (value, address) = (self.pop()?.number(), self.pop()?.number());
        self.settle(|other| other.reads_memory);
        let is_aligned = at.align == at.max_align || bytes.is_empty();
        let name = if is_aligned { aligned } else { bytes };
        let value = if cast.is_empty() { value } else { value.unary(cast, Type::Word) };
        self.line(format!("{name}(m, {}, {}u, {});", address.text, at.offset, value.text));
        Ok(())
    }

    fn two(&mut self) -> Result<(Value, Value), Error> {
        let right = self.pop()?;
        Ok((self.pop()?, right))
    }

    fn comparison(&mut self, symbol: &str) -> Result<(), Error> {
        let (left, right) = self.two()?;
        self.push(Value::comparison(&left, symbol, &right));
        Ok(())
    }

    fn signed_comparison(&mut self, symbol: &str) -> Result<(), Error> {
        let (left, right) = self.two()?;
        let signed = |value: &Value| value.unary("(int32_t)", Type::Word);
        self.push(Value::comparison(&signed(&left), symbol, &signed(&right)));
        Ok(())
    }

    fn binary(&mut self, symbol: &str, binding: Binding) -> Result<(), Error> {
        let (left, right) = self.two()?;
        self.push(Value::binary(&left, symbol, &right, binding));
        Ok(())
    }

    /// A sum of words, where a large number that is added is a small one that is subtracted.
    fn sum(&mut self) -> Result<(), Error> {
        let (left, right) = self.two()?;
        // From 4096 below zero on.
        let small = right.constant.and_then(|value| u32::try_from(value).ok()).filter(|value| *value > u32::MAX - 4096);
        self.push(match small {
            Some(value) => Value::binary(&left, "-", &Value::word(value.wrapping_neg()), Binding::Sum),
            None => Value::binary(&left, "+", &right, Binding::Sum),
        });
        Ok(())
    }

    fn logic(&mut self, bits: &str, truths: &str) -> Result<(), Error> {
        let (left, right) = self.two()?;
        let value = Value::logic(&left, truths, &right);
        self.push(value.unwrap_or_else(|| Value::binary(&left, bits, &right, Binding::Bits)));
        Ok(())
    }

    /// A shift by a number of bits below the width, as WebAssembly takes it.
    fn shift(&mut self, symbol: &str, width: u32) -> Result<(), Error> {
        let (left, right) = self.two()?;
        let by = match right.constant {
            Some(value) => Value::word((value % u64::from(width)) as u32),
            None => {
                let by = if width == 64 { right.unary("(uint32_t)", Type::Word) } else { right };
                Value::binary(&by, "&", &Value::word(width - 1), Binding::Bits)
            }
        };
        self.push(Value::binary(&left, symbol, &by, Binding::Bits));
        Ok(())
    }

    fn of_one(&mut self, name: &str, ty: Type) -> Result<(), Error> {
        let value = self.pop()?;
        self.push(Value::call(name, &[&value], ty));
        Ok(())
    }

    fn of_two(&mut self, name: &str, ty: Type) -> Result<(), Error> {
        let (left, right) = self.two()?;
        self.push(Value::call(name, &[&left, &right], ty));
        Ok(())
    }

    fn cast(&mut self, name: &str, ty: Type) -> Result<(), Error> {
        let value = self.pop()?;
        self.push(value.unary(name, ty));
        Ok(())
    }
}
