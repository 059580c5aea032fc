//! A function of C for a function of the module.

mod arithmetic;

use std::collections::BTreeSet;
use std::fmt::Write as _;

use wasmparser::{BlockType, BrTable, Operator};

use crate::calls::Needs;
use crate::error::Error;
use crate::expression::{STACK, Type, Value};
use crate::module::{Function, Module, STACK_POINTER};

/// Longest expression of a line; a longer one gets a variable.
const LONGEST: usize = 140;
/// Longest line of declarations.
const LINE: usize = 130;

/// A block that is open.
struct Frame {
    kind: Kind,
    /// Values below it on the stack.
    height: usize,
    /// Variable that takes its result.
    result: Option<(String, Type)>,
    /// Number of its label.
    label: usize,
    /// Jumps to it.
    jumps: usize,
    /// Line that it begins at.
    line: usize,
    /// Whether what follows can be reached.
    is_reachable: bool,
    /// Whether the end of the part before `else` is reached; `None` without an `else`.
    first_part_ends: Option<bool>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Function,
    Block,
    Loop,
    If,
}

/// What functions are called and what they need.
pub(crate) struct Known<'m, 'a> {
    pub(crate) module: &'m Module<'a>,
    pub(crate) names: &'m [String],
    pub(crate) needs: &'m [Needs],
}

/// A function of C, without its documentation.
pub(crate) fn function(index: usize, known: &Known<'_, '_>) -> Result<String, Error> {
    let function = &known.module.functions[index];
    let types = function.locals.iter().map(|ty| Type::of(*ty)).collect::<Result<Vec<_>, _>>()?;
    let result = result_of(&function.signature)?;
    let mut writer = Writer {
        known,
        function,
        names: types.iter().enumerate().map(|(at, ty)| format!("{}{at}", ty.letter())).collect(),
        types,
        lines: vec![],
        depth: 1,
        values: vec![],
        frames: vec![],
        used: BTreeSet::new(),
        labels: 0,
        temporaries: 0,
        skipped: 0,
    };
    writer.frames.push(Frame {
        kind: Kind::Function,
        height: 0,
        result: result.map(|ty| (String::new(), ty)),
        label: 0,
        jumps: 0,
        line: 0,
        is_reachable: true,
        first_part_ends: None,
    });
    let mut operators = function.body.iter().peekable();
    while let Some(operator) = operators.next() {
        writer.operator(operator, operators.peek().copied())?;
    }
    Ok(writer.finish(&signature(index, known)?))
}

/// The declaration of a function, without a semicolon.
fn signature(index: usize, known: &Known<'_, '_>) -> Result<String, Error> {
    let function = &known.module.functions[index];
    let needs = known.needs[index];
    let mut parameters = Vec::new();
    if needs.memory {
        parameters.push("uint8_t *m".to_owned());
    }
    if needs.stack {
        parameters.push("uint32_t sp".to_owned());
    }
    for (at, ty) in function.signature.params().iter().enumerate() {
        let ty = Type::of(*ty)?;
        parameters.push(format!("{} {}{at}", ty.name(), ty.letter()));
    }
    if parameters.is_empty() {
        parameters.push("void".to_owned());
    }
    let result = result_of(&function.signature)?.map_or("void", Type::name);
    Ok(format!("static {result} {}({})", known.names[index], parameters.join(", ")))
}

fn result_of(signature: &wasmparser::FuncType) -> Result<Option<Type>, Error> {
    match signature.results() {
        [] => Ok(None),
        [ty] => Type::of(*ty).map(Some),
        _ => Err(Error::Part("a function with several results")),
    }
}

struct Writer<'m, 'a> {
    known: &'m Known<'m, 'a>,
    function: &'m Function<'a>,
    names: Vec<String>,
    types: Vec<Type>,
    lines: Vec<(usize, String)>,
    depth: usize,
    values: Vec<Value>,
    frames: Vec<Frame>,
    /// Local variables in the text.
    used: BTreeSet<u32>,
    labels: usize,
    temporaries: usize,
    /// Blocks that began in what cannot be reached.
    skipped: usize,
}

impl Writer<'_, '_> {
    fn line(&mut self, text: impl Into<String>) {
        self.lines.push((self.depth, text.into()));
    }

    fn not_translated(&self, operator: &Operator<'_>) -> Error {
        let instruction = format!("{operator:?}");
        let instruction = instruction.split([' ', '{']).next().unwrap_or_default().to_owned();
        Error::Instruction { function: self.function.symbol.clone(), instruction }
    }

    fn pop(&mut self) -> Result<Value, Error> {
        self.values.pop().ok_or_else(|| Error::NotAModule("a value is missing on the stack".to_owned()))
    }

    fn push(&mut self, value: Value) {
        if value.text.len() > LONGEST {
            let value = self.in_variable(&value);
            self.values.push(value);
        } else {
            self.values.push(value);
        }
    }

    /// Puts a value into a variable of its own.
    fn in_variable(&mut self, value: &Value) -> Value {
        let value = value.number();
        self.temporaries += 1;
        let name = format!("t{}", self.temporaries);
        self.line(format!("const {} {name} = {};", value.ty.name(), value.text));
        Value::primary(name, value.ty)
    }

    /// Puts the values on the stack that `which` names into variables, before what they read changes.
    fn settle(&mut self, which: impl Fn(&Value) -> bool) {
        for at in 0..self.values.len() {
            if which(&self.values[at]) {
                let value = self.values[at].clone();
                self.values[at] = self.in_variable(&value);
            }
        }
    }

    fn settle_all(&mut self) {
        let stays = |value: &Value| value.is_constant || (value.is_primary() && value.text.starts_with(['t', 'r']));
        self.settle(|value| !stays(value));
    }

    fn local(&mut self, index: u32) -> Value {
        self.used.insert(index);
        Value::local(index, &self.names[index as usize], self.types[index as usize])
    }

    /// Assigns a value to a local variable, unless a call has just done so.
    fn assign(&mut self, index: u32, value: &Value) {
        self.used.insert(index);
        self.settle(|other| other.reads(index));
        let text = value.number().text;
        let name = self.names[index as usize].clone();
        if text != name {
            self.line(format!("{name} = {text};"));
        }
    }

    fn operator(&mut self, operator: &Operator<'_>, next: Option<&Operator<'_>>) -> Result<(), Error> {
        if !self.frames.last().is_some_and(|frame| frame.is_reachable) {
            match operator {
                Operator::Block { .. } | Operator::Loop { .. } | Operator::If { .. } => self.skipped += 1,
                Operator::End if self.skipped > 0 => self.skipped -= 1,
                Operator::Else if self.skipped == 0 => self.otherwise()?,
                Operator::End => self.end()?,
                _ => {}
            }
            return Ok(());
        }
        match operator {
            Operator::Block { blockty } => self.open(Kind::Block, *blockty, None)?,
            Operator::Loop { blockty } => self.open(Kind::Loop, *blockty, None)?,
            Operator::If { blockty } => {
                let condition = self.pop()?;
                self.open(Kind::If, *blockty, Some(&condition))?;
            }
            Operator::Else => self.otherwise()?,
            Operator::End => self.end()?,
            Operator::Br { relative_depth } => {
                self.jump(*relative_depth)?;
                self.stop();
            }
            Operator::BrIf { relative_depth } => self.jump_if(*relative_depth)?,
            Operator::BrTable { targets } => self.switch(targets)?,
            Operator::Return => {
                self.jump(self.frames.len() as u32 - 1)?;
                self.stop();
            }
            Operator::Unreachable => {
                // The compiler has shown that no call comes here.
                self.leave_unreached();
                self.stop();
            }
            Operator::Nop => {}
            Operator::Drop => drop(self.pop()?),
            Operator::Call { function_index } => return self.call(*function_index as usize, next),
            Operator::LocalGet { local_index } => {
                let value = self.local(*local_index);
                self.push(value);
            }
            Operator::LocalSet { local_index } => {
                let value = self.pop()?;
                self.assign(*local_index, &value);
            }
            Operator::LocalTee { local_index } => {
                let value = self.pop()?;
                self.assign(*local_index, &value);
                let value = self.local(*local_index);
                self.push(value);
            }
            Operator::GlobalGet { global_index: STACK_POINTER } => {
                self.values.push(Value::local(STACK, "sp", Type::Word));
            }
            Operator::GlobalSet { global_index: STACK_POINTER } => {
                let value = self.pop()?;
                self.settle(|other| other.reads(STACK));
                self.line(format!("sp = {};", value.number().text));
            }
            Operator::Select => {
                let (condition, no, yes) = (self.pop()?, self.pop()?, self.pop()?);
                self.push(Value::choice(&condition, &yes, &no));
            }
            Operator::MemoryCopy { .. } | Operator::MemoryFill { .. } => {
                let (count, from, to) = (self.pop()?.number(), self.pop()?.number(), self.pop()?.number());
                self.settle(|other| other.reads_memory);
                let name = if matches!(operator, Operator::MemoryFill { .. }) { "fill" } else { "copy" };
                self.line(format!("{name}(m, {}, {}, {});", to.text, from.text, count.text));
            }
            _ => self.arithmetic(operator)?,
        }
        Ok(())
    }

    /// A call, whose result goes into the variable that the next instruction assigns, or into one of its own.
    fn call(&mut self, index: usize, next: Option<&Operator<'_>>) -> Result<(), Error> {
        let called = &self.known.module.functions[index];
        let needs = self.known.needs[index];
        let mut arguments = Vec::new();
        for _ in called.signature.params() {
            arguments.push(self.pop()?.number().text);
        }
        if needs.stack {
            arguments.push("sp".to_owned());
        }
        if needs.memory {
            arguments.push("m".to_owned());
            self.settle(|other| other.reads_memory);
        }
        arguments.reverse();
        let call = format!("{}({})", self.known.names[index], arguments.join(", "));
        let Some(ty) = result_of(&called.signature)? else {
            self.line(format!("{call};"));
            return Ok(());
        };
        if let Some(Operator::LocalSet { local_index }) = next {
            let index = *local_index;
            self.used.insert(index);
            self.settle(|other| other.reads(index));
            self.line(format!("{} = {call};", self.names[index as usize]));
            // The assignment that follows is this one: it has nothing left to do.
            let value = self.local(index);
            self.values.push(value);
            return Ok(());
        }
        if matches!(next, Some(Operator::Drop)) {
            self.line(format!("(void){call};"));
            self.values.push(Value::word(0));
            return Ok(());
        }
        let value = self.in_variable(&Value::primary(call, ty));
        self.values.push(value);
        Ok(())
    }

    fn open(&mut self, kind: Kind, ty: BlockType, condition: Option<&Value>) -> Result<(), Error> {
        let result = match ty {
            BlockType::Empty => None,
            BlockType::Type(ty) => Some(Type::of(ty)?),
            BlockType::FuncType(index) => match self.known.module.types.get(index as usize) {
                Some(ty) if ty.params().is_empty() => result_of(ty)?,
                _ => return Err(Error::Part("a block with parameters")),
            },
        };
        self.settle_all();
        self.labels += 1;
        let label = self.labels;
        let result = result.map(|ty| (format!("r{label}"), ty));
        if let Some((name, ty)) = &result {
            self.line(format!("{} {name};", ty.name()));
        }
        let line = self.lines.len();
        match condition {
            Some(condition) => self.line(format!("if ({}) {{", condition.condition())),
            // The line of a loop is written at its end.
            None if kind == Kind::Loop => self.line(""),
            None => {}
        }
        if kind != Kind::Block {
            self.depth += 1;
        }
        let height = self.values.len();
        self.frames.push(Frame {
            kind,
            height,
            result,
            label,
            jumps: 0,
            line,
            is_reachable: true,
            first_part_ends: None,
        });
        Ok(())
    }

    fn stop(&mut self) {
        if let Some(frame) = self.frames.last_mut() {
            frame.is_reachable = false;
        }
    }

    fn leave_unreached(&mut self) {
        let text = match &self.frames[0].result {
            Some((_, ty)) => format!("return {}; /* never reached */", ty.zero()),
            None => "return; /* never reached */".to_owned(),
        };
        self.line(text);
    }

    /// Leaves for a block that is open.
    fn jump(&mut self, relative_depth: u32) -> Result<(), Error> {
        let at = self.frames.len() - 1 - relative_depth as usize;
        let (kind, result, label) = {
            let frame = &mut self.frames[at];
            frame.jumps += 1;
            (frame.kind, frame.result.clone(), frame.label)
        };
        match (kind, result) {
            (Kind::Loop, _) => self.line(format!("goto again_{label};")),
            (Kind::Function, None) => self.line("return;"),
            (Kind::Function, Some(_)) => {
                let value = self.top()?;
                self.line(format!("return {value};"));
            }
            (_, result) => {
                if let Some((name, _)) = result {
                    let value = self.top()?;
                    self.line(format!("{name} = {value};"));
                }
                self.line(format!("goto end_{label};"));
            }
        }
        Ok(())
    }

    fn top(&self) -> Result<String, Error> {
        let top = self.values.last().map(|value| value.number().text);
        top.ok_or_else(|| Error::NotAModule("a value is missing on the stack".to_owned()))
    }

    fn jump_if(&mut self, relative_depth: u32) -> Result<(), Error> {
        let condition = self.pop()?.condition();
        let at = self.frames.len() - 1 - relative_depth as usize;
        if self.frames[at].result.is_some() && self.frames[at].kind != Kind::Loop {
            let value = self.pop()?;
            let value = if value.is_primary() { value } else { self.in_variable(&value) };
            self.values.push(value);
        }
        self.line(format!("if ({condition}) {{"));
        self.depth += 1;
        self.jump(relative_depth)?;
        self.depth -= 1;
        self.line("}");
        Ok(())
    }

    fn switch(&mut self, targets: &BrTable<'_>) -> Result<(), Error> {
        let selector = self.pop()?.number();
        self.line(format!("switch ({}) {{", selector.text));
        let all = targets.targets().collect::<Result<Vec<_>, _>>()?;
        let mut at = 0;
        while at < all.len() {
            // Neighbours with one target stand together.
            let same = all[at..].iter().take_while(|target| **target == all[at]).count();
            if all[at] != targets.default() {
                for case in at..at + same {
                    self.line(format!("case {case}u:"));
                }
                self.depth += 1;
                self.jump(all[at])?;
                self.depth -= 1;
            }
            at += same;
        }
        self.line("default:");
        self.depth += 1;
        self.jump(targets.default())?;
        self.depth -= 1;
        self.line("}");
        self.stop();
        Ok(())
    }

    /// The result of a block that ends here.
    fn keep_result(&mut self) -> Result<(), Error> {
        let Some(frame) = self.frames.last() else { return Ok(()) };
        if let (true, Some((name, _))) = (frame.is_reachable, frame.result.clone()) {
            let value = self.top()?;
            self.line(format!("{name} = {value};"));
        }
        Ok(())
    }

    fn otherwise(&mut self) -> Result<(), Error> {
        self.keep_result()?;
        self.depth -= 1;
        self.line("} else {");
        self.depth += 1;
        if let Some(frame) = self.frames.last_mut() {
            self.values.truncate(frame.height);
            frame.first_part_ends = Some(frame.is_reachable);
            frame.is_reachable = true;
        }
        Ok(())
    }

    fn end(&mut self) -> Result<(), Error> {
        if self.frames.len() == 1 {
            let is_reachable = self.frames[0].is_reachable;
            if is_reachable && self.frames[0].result.is_some() {
                let value = self.top()?;
                self.line(format!("return {value};"));
            }
            return Ok(());
        }
        self.keep_result()?;
        let Some(mut frame) = self.frames.pop() else { return Ok(()) };
        match frame.kind {
            Kind::If => {
                self.depth -= 1;
                self.line("}");
            }
            Kind::Loop => self.close_loop(&mut frame),
            Kind::Block | Kind::Function => {}
        }
        if frame.kind != Kind::Loop && frame.jumps > 0 {
            self.line(format!("end_{}:;", frame.label));
        }
        self.values.truncate(frame.height);
        if let Some((name, ty)) = frame.result {
            self.values.push(Value::primary(name, ty));
        }
        // A block is left by its end or by a jump to it. Behind one that is never left nothing is reached either.
        let is_left = frame.is_reachable
            || (frame.kind != Kind::Loop && frame.jumps > 0)
            || (frame.kind == Kind::If && frame.first_part_ends != Some(false));
        if !is_left {
            self.stop();
        }
        Ok(())
    }

    /// A loop that ends in a jump to its begin is `do ... while`, or one without end; another one is left at its end.
    fn close_loop(&mut self, frame: &mut Frame) {
        self.depth -= 1;
        let back = format!("goto again_{};", frame.label);
        let count = self.lines.len();
        let tail = |from_end: usize| self.lines.get(count.wrapping_sub(from_end)).map(|line| line.1.as_str());
        let (head, foot) = if frame.is_reachable && tail(1) == Some("}") && tail(2) == Some(back.as_str()) {
            let condition = tail(3).and_then(|line| line.strip_prefix("if (")?.strip_suffix(") {")).map(str::to_owned);
            match condition {
                Some(condition) if !self.is_of_body(&condition, frame.line) => {
                    self.lines.truncate(count - 3);
                    frame.jumps -= 1;
                    ("do {", format!("}} while ({condition});"))
                }
                _ => ("for (;;) {", String::new()),
            }
        } else if !frame.is_reachable && tail(1) == Some(back.as_str()) {
            self.lines.truncate(count - 1);
            frame.jumps -= 1;
            ("for (;;) {", "}".to_owned())
        } else {
            ("for (;;) {", String::new())
        };
        let foot = if foot.is_empty() {
            if frame.is_reachable {
                self.depth += 1;
                self.line("break;");
                self.depth -= 1;
            }
            "}".to_owned()
        } else {
            foot
        };
        self.line(foot);
        let label = if frame.jumps > 0 { format!("again_{}: ", frame.label) } else { String::new() };
        self.lines[frame.line].1 = format!("{label}{head}");
    }

    /// Whether a condition reads a variable that is declared behind this line, within the braces of a loop.
    fn is_of_body(&self, condition: &str, line: usize) -> bool {
        let names = condition.split(|c: char| !c.is_ascii_alphanumeric()).filter(|name| name.starts_with(['t', 'r']));
        let mut names = names.filter(|name| name[1..].starts_with(|c: char| c.is_ascii_digit()));
        names.any(|name| {
            let declares = |text: &str| text.contains(&format!(" {name} =")) || text.ends_with(&format!(" {name};"));
            self.lines[line + 1..].iter().any(|(_, text)| declares(text))
        })
    }

    /// The whole function.
    fn finish(self, signature: &str) -> String {
        let mut text = format!("{signature}\n{{\n");
        let parameters = self.function.signature.params().len();
        for at in 0..parameters as u32 {
            if !self.used.contains(&at) {
                let _ = writeln!(text, "  (void){};", self.names[at as usize]);
            }
        }
        for ty in [Type::Word, Type::Long, Type::Single] {
            let mut line = String::new();
            let used = self.used.iter().filter(|at| **at as usize >= parameters && self.types[**at as usize] == ty);
            for at in used {
                if line.len() > LINE {
                    let _ = writeln!(text, "{line}");
                    line.clear();
                }
                let start = if line.is_empty() { " " } else { "" };
                let _ = write!(line, "{start} {} {} = {};", ty.name(), self.names[*at as usize], ty.zero());
            }
            if !line.is_empty() {
                let _ = writeln!(text, "{line}");
            }
        }
        for (depth, line) in &self.lines {
            let depth = if line.starts_with("end_") { depth - 1 } else { *depth };
            let _ = writeln!(text, "{:indent$}{line}", "", indent = 2 * depth);
        }
        text.push_str("}\n");
        text
    }
}
