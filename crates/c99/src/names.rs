//! Names of C functions, and what the Rust path of a function is made of.

use std::collections::HashSet;

/// Where a function stands in the Rust sources.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RustPath {
    /// Path of its module, as `observer::gearbox::predict`.
    pub(crate) module: String,
    /// The type that it belongs to, if it does.
    pub(crate) of: Option<String>,
    /// Its name.
    pub(crate) name: String,
    /// Whether it is a closure of that function.
    pub(crate) is_closure: bool,
}

impl RustPath {
    /// Of a symbol. What is not mangled has its name alone.
    pub(crate) fn of(symbol: &str) -> Self {
        let plain = format!("{:#}", rustc_demangle::demangle(symbol));
        let is_closure = plain.contains("{{closure}}") || plain.contains("{closure#");
        let segments = segments(&plain);
        let mut named: Vec<String> = segments.into_iter().filter(|segment| !segment.starts_with('{')).collect();
        let name = named.pop().unwrap_or(plain);
        let mut of = None;
        let mut module = Vec::new();
        for segment in named {
            let (inner, is_impl) = within_impl(&segment);
            let last = inner.rsplit("::").next().unwrap_or(inner);
            if is_impl || last.starts_with(char::is_uppercase) {
                of = Some(without_arguments(last));
                if module.is_empty()
                    && let Some((path, _)) = inner.rsplit_once("::")
                {
                    module.push(without_arguments(path));
                }
            } else {
                module.push(without_arguments(&segment));
            }
        }
        Self { module: module.join("::"), of, name: without_arguments(&name), is_closure }
    }

    /// Whether it is the square root in software, which gives the bits of the standard, as processors do.
    pub(crate) fn is_square_root(&self) -> bool {
        self.module.starts_with("libm::") && self.name == "sqrtf"
    }

    /// The name of the C function.
    pub(crate) fn c_name(&self) -> String {
        let of = self.of.as_deref().or_else(|| self.module.rsplit("::").next()).unwrap_or_default();
        // Names without a path are those of the C library.
        let mut name = if of.is_empty() { "rust".to_owned() } else { snake_case(of) };
        name.push('_');
        name.push_str(&snake_case(&self.name));
        if self.is_closure {
            name.push_str("_part");
        }
        name
    }
}

impl std::fmt::Display for RustPath {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let module = if self.module.is_empty() { String::new() } else { format!("{}::", self.module) };
        let of = self.of.as_ref().map_or_else(String::new, |of| format!("{of}::"));
        let part = if self.is_closure { ", a part of it" } else { "" };
        write!(formatter, "{module}{of}{}{part}", self.name)
    }
}

/// The parts of a path between `::` outside brackets.
fn segments(path: &str) -> Vec<String> {
    let (mut segments, mut depth, mut current) = (vec![], 0_i32, String::new());
    let mut characters = path.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '<' | '[' | '(' => depth += 1,
            '>' | ']' | ')' => depth -= 1,
            ':' if depth == 0 && characters.peek() == Some(&':') => {
                characters.next();
                segments.push(std::mem::take(&mut current));
                continue;
            }
            _ => {}
        }
        current.push(character);
    }
    segments.push(current);
    segments.retain(|segment| !segment.is_empty());
    segments
}

/// The type of `<impl T>`, `<impl Trait for T>` and `<T as Trait>`, and whether this is such a segment.
fn within_impl(segment: &str) -> (&str, bool) {
    let Some(inner) = segment.strip_prefix('<').and_then(|rest| rest.strip_suffix('>')) else {
        return (segment, false);
    };
    let inner = inner.strip_prefix("impl ").unwrap_or(inner);
    let inner = inner.rsplit_once(" for ").map_or(inner, |(_, of)| of);
    (inner.split_once(" as ").map_or(inner, |(of, _)| of), true)
}

/// A path without what stands in brackets.
fn without_arguments(path: &str) -> String {
    let (mut depth, mut plain) = (0, String::new());
    for character in path.chars() {
        match character {
            '<' | '[' => depth += 1,
            '>' | ']' => depth -= 1,
            _ if depth == 0 => plain.push(character),
            _ => {}
        }
    }
    plain.trim_end_matches(':').to_owned()
}

fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    for character in name.chars() {
        if character.is_ascii_uppercase() && !snake.is_empty() && !snake.ends_with('_') {
            snake.push('_');
        }
        if character.is_ascii_alphanumeric() || character == '_' {
            snake.push(character.to_ascii_lowercase());
        }
    }
    snake
}

/// Gives each function a name of its own.
#[derive(Default)]
pub(crate) struct Names {
    taken: HashSet<String>,
}

impl Names {
    /// Leaves the names of a text to it, but for those of the functions of the module.
    pub(crate) fn reserve(&mut self, text: &str) {
        let names = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
        self.taken.extend(names.filter(|name| !name.starts_with("inner_")).map(str::to_owned));
    }

    /// This name, with a number behind it if it is taken.
    pub(crate) fn take(&mut self, name: &str) -> String {
        let mut names = (1..).map(|number| if number == 1 { name.to_owned() } else { format!("{name}_{number}") });
        let name = names.find(|name| !self.taken.contains(name)).unwrap_or_default();
        self.taken.insert(name.clone());
        name
    }
}

#[cfg(test)]
mod tests {
    use super::RustPath;

    fn parts(symbol: &str) -> (String, Option<String>, String, String) {
        let path = RustPath::of(symbol);
        let c_name = path.c_name();
        (path.module, path.of, path.name, c_name)
    }

    #[test]
    fn a_method_has_its_type_and_the_module_that_it_stands_in() {
        let (module, of, name, c_name) = parts(
            "_ZN8observer7gearbox5doubt59_$LT$impl$u20$observer..gearbox..GearboxFilter$LT$T$GT$$GT$10predict_at17h92a0ba28becf39a5E",
        );
        assert_eq!((module.as_str(), of.as_deref()), ("observer::gearbox::doubt", Some("GearboxFilter")));
        assert_eq!((name.as_str(), c_name.as_str()), ("predict_at", "gearbox_filter_predict_at"));
    }

    #[test]
    fn a_method_in_the_module_of_its_type() {
        let (module, of, name, _) =
            parts("_ZN8observer7gearbox10covariance17Gaussian$LT$T$GT$7correct17h0e7cc5902928eac3E");
        assert_eq!((module.as_str(), of.as_deref()), ("observer::gearbox::covariance", Some("Gaussian")));
        assert_eq!(name, "correct");
    }

    #[test]
    fn a_function_a_trait_and_a_closure() {
        assert_eq!(parts("_ZN4libm4math4expf4expf17h924e5b3350f921afE").3, "expf_expf");
        let (module, of, ..) =
            parts("_ZN68_$LT$core..option..Option$LT$L$GT$$u20$as$u20$ecu..words..Layout$GT$4take17ha012664bcb474430E");
        assert_eq!((module.as_str(), of.as_deref()), ("core::option", Some("Option")));
        let closure = "_ZN8observer7gearbox7predict59_$LT$impl$u20$observer..gearbox..GearboxFilter$LT$T$GT$$GT$10find_phase28_$u7b$$u7b$closure$u7d$$u7d$17hda58eb5a0be6ab0cE";
        assert_eq!(parts(closure).3, "gearbox_filter_find_phase_part");
        assert_eq!(parts("fmaxf").3, "rust_fmaxf");
    }
}
