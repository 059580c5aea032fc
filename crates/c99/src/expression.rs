//! Expressions of C: what stands on the stack of WebAssembly's machine until it is used.

use wasmparser::ValType;

use crate::error::Error;

/// Types of C that there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Type {
    /// `uint32_t`
    Word,
    /// `uint64_t`
    Long,
    /// `float`
    Single,
}

impl Type {
    pub(crate) fn of(ty: ValType) -> Result<Self, Error> {
        match ty {
            ValType::I32 => Ok(Self::Word),
            ValType::I64 => Ok(Self::Long),
            ValType::F32 => Ok(Self::Single),
            _ => Err(Error::Part("a type other than whole numbers and single precision")),
        }
    }

    /// The type in C.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Word => "uint32_t",
            Self::Long => "uint64_t",
            Self::Single => "float",
        }
    }

    /// First letter of the names of variables.
    pub(crate) fn letter(self) -> char {
        match self {
            Self::Word => 'u',
            Self::Long => 'w',
            Self::Single => 'f',
        }
    }

    /// Zero.
    pub(crate) fn zero(self) -> &'static str {
        match self {
            Self::Word => "0u",
            Self::Long => "UINT64_C(0)",
            Self::Single => "0.0f",
        }
    }
}

/// How strongly the parts of an expression are bound: those of C, the strongest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Binding {
    /// Names, numbers, calls.
    Primary,
    /// Casts, signs.
    Unary,
    /// `*` `/` `%`
    Product,
    /// `+` `-`
    Sum,
    /// `<<` `>>` `&` `^` `|`: always in brackets, also with each other.
    Bits,
    /// `<` `==` ...
    Comparison,
    /// `&&` `||`
    Logic,
    /// `?:`
    Choice,
}

/// An expression without side effects.
#[derive(Debug, Clone)]
pub(crate) struct Value {
    pub(crate) text: String,
    pub(crate) ty: Type,
    binding: Binding,
    /// It is an `int` of C, 0 or 1.
    is_truth: bool,
    /// Its value, if it is a constant whole number.
    pub(crate) constant: Option<u64>,
    /// Whether it is a number.
    pub(crate) is_constant: bool,
    pub(crate) reads_memory: bool,
    /// Local variables that it reads; the stack pointer is `u32::MAX`.
    locals: Vec<u32>,
}

/// The stack pointer among the local variables.
pub(crate) const STACK: u32 = u32::MAX;

impl Value {
    /// A name or a number.
    pub(crate) fn primary(text: impl Into<String>, ty: Type) -> Self {
        Self {
            text: text.into(),
            ty,
            binding: Binding::Primary,
            is_truth: false,
            constant: None,
            is_constant: false,
            reads_memory: false,
            locals: vec![],
        }
    }

    /// A local variable.
    pub(crate) fn local(index: u32, name: &str, ty: Type) -> Self {
        Self { locals: vec![index], ..Self::primary(name, ty) }
    }

    /// A word.
    pub(crate) fn word(value: u32) -> Self {
        Self { constant: Some(value.into()), is_constant: true, ..Self::primary(word(value), Type::Word) }
    }

    /// A long.
    pub(crate) fn long(value: u64) -> Self {
        let text = format!("UINT64_C({value:#x})");
        Self { constant: Some(value), is_constant: true, ..Self::primary(text, Type::Long) }
    }

    /// A number of single precision, to the last bit.
    pub(crate) fn single(bits: u32) -> Self {
        let value = f32::from_bits(bits);
        let text = if value.is_finite() { hex_float(value) } else { format!("single({})", word(bits)) };
        let binding = if text.starts_with('-') { Binding::Unary } else { Binding::Primary };
        Self { is_constant: true, binding, ..Self::primary(text, Type::Single) }
    }

    /// Whether it reads this local variable.
    pub(crate) fn reads(&self, local: u32) -> bool {
        self.locals.contains(&local)
    }

    /// Whether it is a name or a number, which need no variable.
    pub(crate) fn is_primary(&self) -> bool {
        self.binding == Binding::Primary && !self.reads_memory && !self.text.contains('(')
    }

    /// An expression of the parts of this one.
    fn with(&self, text: String, ty: Type, binding: Binding) -> Self {
        Self { text, ty, binding, is_truth: false, constant: None, is_constant: false, ..self.clone() }
    }

    /// The reads of another expression as well.
    fn and(mut self, other: &Self) -> Self {
        self.reads_memory |= other.reads_memory;
        self.locals.extend(&other.locals);
        self
    }

    /// As a number: what is true is 1.
    pub(crate) fn number(&self) -> Self {
        if self.is_truth {
            return self.with(format!("(uint32_t)({})", self.text), Type::Word, Binding::Unary);
        }
        self.clone()
    }

    /// As a condition.
    pub(crate) fn condition(&self) -> String {
        if self.is_truth { self.text.clone() } else { format!("{} != 0u", self.within(Binding::Sum)) }
    }

    /// In brackets if it is bound less strongly than this.
    fn within(&self, binding: Binding) -> String {
        if self.binding > binding { format!("({})", self.text) } else { self.text.clone() }
    }

    /// `left symbol right`.
    pub(crate) fn binary(left: &Self, symbol: &str, right: &Self, binding: Binding) -> Self {
        let (left, right) = (left.number(), right.number());
        // Of equal strength: from the left. The right one is in brackets then.
        let (of_left, of_right) = match binding {
            Binding::Product => (Binding::Product, Binding::Unary),
            Binding::Sum => (Binding::Sum, Binding::Product),
            Binding::Comparison => (Binding::Sum, Binding::Sum),
            _ => (Binding::Unary, Binding::Unary),
        };
        let text = format!("{} {symbol} {}", left.within(of_left), right.within(of_right));
        left.with(text, left.ty, binding).and(&right)
    }

    /// `left symbol right`, 0 or 1.
    pub(crate) fn comparison(left: &Self, symbol: &str, right: &Self) -> Self {
        let compared = Self::binary(left, symbol, right, Binding::Comparison);
        Self { ty: Type::Word, is_truth: true, ..compared }
    }

    /// Both, or one of both, where both are 0 or 1.
    pub(crate) fn logic(left: &Self, symbol: &str, right: &Self) -> Option<Self> {
        if !left.is_truth || !right.is_truth {
            return None;
        }
        let text = format!("{} {symbol} {}", left.within(Binding::Sum), right.within(Binding::Sum));
        Some(Self { is_truth: true, ..left.with(text, Type::Word, Binding::Logic).and(right) })
    }

    /// 1 where this is 0.
    pub(crate) fn is_zero(&self) -> Self {
        let (text, binding) = if self.is_truth {
            (format!("!({})", self.text), Binding::Unary)
        } else {
            let zero = if self.ty == Type::Long { Type::Long.zero() } else { "0u" };
            (format!("{} == {zero}", self.within(Binding::Sum)), Binding::Comparison)
        };
        Self { is_truth: true, ..self.with(text, Type::Word, binding) }
    }

    /// A sign before it, or a cast.
    pub(crate) fn unary(&self, symbol: &str, ty: Type) -> Self {
        let number = self.number();
        number.with(format!("{symbol}{}", number.within(Binding::Primary)), ty, Binding::Unary)
    }

    /// A function of the C library or of the prelude.
    pub(crate) fn call(name: &str, arguments: &[&Self], ty: Type) -> Self {
        let texts: Vec<String> = arguments.iter().map(|argument| argument.number().text).collect();
        let call = Self::primary(format!("{name}({})", texts.join(", ")), ty);
        arguments.iter().fold(call, |call, argument| call.and(argument))
    }

    /// What stands in memory at this address and an offset.
    pub(crate) fn load(name: &str, address: &Self, offset: u64, ty: Type) -> Self {
        let call = Self::primary(format!("{name}(m, {}, {offset}u)", address.number().text), ty).and(address);
        Self { reads_memory: true, ..call }
    }

    /// `condition ? yes : no`.
    pub(crate) fn choice(condition: &Self, yes: &Self, no: &Self) -> Self {
        let text = format!(
            "({}) ? {} : {}",
            condition.condition(),
            yes.number().within(Binding::Unary),
            no.number().within(Binding::Unary)
        );
        yes.number().with(text, yes.ty, Binding::Choice).and(no).and(condition)
    }
}

/// A word as an unsigned number of C.
fn word(value: u32) -> String {
    if value < 4096 || value.is_multiple_of(1000) { format!("{value}u") } else { format!("{value:#x}u") }
}

/// A finite number as a hexadecimal one of C.
fn hex_float(value: f32) -> String {
    let bits = value.to_bits();
    let sign = if value.is_sign_negative() { "-" } else { "" };
    let (exponent, mantissa) = ((bits >> 23) & 0xff, bits & 0x7f_ffff);
    // Numbers that are exact in a few decimal digits are easier to read so.
    let plain = format!("{:?}", value.abs());
    if plain.len() <= 6 && !plain.contains('e') && value.fract() == 0.0 {
        return format!("{sign}{plain}f");
    }
    match (exponent, mantissa) {
        (0, 0) => format!("{sign}0.0f"),
        (0, _) => format!("{sign}0x0.{:06x}p-126f", mantissa << 1),
        _ => {
            let digits = format!("{:06x}", mantissa << 1);
            let digits = digits.trim_end_matches('0');
            let point = if digits.is_empty() { "" } else { "." };
            format!("{sign}0x1{point}{digits}p{:+}f", exponent.cast_signed() - 127)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Binding, Type, Value, hex_float};

    fn single(name: &str) -> Value {
        Value::primary(name, Type::Single)
    }

    #[test]
    fn a_number_keeps_its_bits() {
        assert_eq!(hex_float(1.0), "1.0f");
        assert_eq!(hex_float(-0.0), "-0.0f");
        assert_eq!(hex_float(0.1), "0x1.99999ap-4f");
        assert_eq!(hex_float(f32::from_bits(1)), "0x0.000002p-126f");
        assert_eq!(hex_float(-f32::MAX), "-0x1.fffffep+127f");
    }

    #[test]
    fn sums_and_products_keep_their_order() {
        let [a, b, c] = ["a", "b", "c"].map(single);
        let sum = Value::binary(&a, "+", &b, Binding::Sum);
        assert_eq!(Value::binary(&sum, "+", &c, Binding::Sum).text, "a + b + c");
        assert_eq!(Value::binary(&c, "+", &sum, Binding::Sum).text, "c + (a + b)");
        let product = Value::binary(&sum, "*", &c, Binding::Product);
        assert_eq!(product.text, "(a + b) * c");
        assert_eq!(Value::binary(&a, "-", &product, Binding::Sum).text, "a - (a + b) * c");
        assert_eq!(Value::binary(&a, "/", &product, Binding::Product).text, "a / ((a + b) * c)");
        let minus = Value::single((-2.5_f32).to_bits());
        assert_eq!(minus.unary("-", Type::Single).text, "-(-0x1.4p+1f)");
    }

    #[test]
    fn a_comparison_is_a_condition_or_a_number() {
        let [a, b] = ["a", "b"].map(single);
        let less = Value::comparison(&a, "<", &b);
        assert_eq!(less.condition(), "a < b");
        assert_eq!(less.is_zero().condition(), "!(a < b)");
        assert_eq!(less.number().text, "(uint32_t)(a < b)");
        let both = Value::logic(&less, "&&", &less.is_zero()).expect("both are comparisons");
        assert_eq!(both.condition(), "(a < b) && !(a < b)");
        assert_eq!(Value::primary("u", Type::Word).condition(), "u != 0u");
        assert!(Value::logic(&less, "&&", &a).is_none());
    }
}
