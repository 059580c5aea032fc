//! Values as words of 32 bits in a fixed order, each with its name.

/// Takes the words of an image in their order, each with its name: a name ends in its unit. A name may be empty.
pub trait Sink {
    /// What follows, up to the end, belongs to this name.
    fn begin(&mut self, name: &'static str);
    /// What follows, up to the end, is this value of an array.
    fn begin_place(&mut self, at: usize);
    /// Ends what was begun last.
    fn end(&mut self);
    /// Numbers in single precision, as one array where there are several.
    fn reals(&mut self, name: &'static str, values: &[f32]);
    /// A count, a place, or a truth value.
    fn whole(&mut self, name: &'static str, value: u32);
}

/// The words of an image that are not yet read.
#[derive(Debug, Clone, Copy)]
pub struct Words<'a> {
    rest: &'a [u32],
}

impl<'a> Words<'a> {
    /// All of these.
    pub fn new(words: &'a [u32]) -> Self {
        Self { rest: words }
    }

    /// The next word.
    pub fn whole(&mut self) -> Option<u32> {
        let (word, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(*word)
    }

    /// The next number; `None` also if it is none.
    pub fn real(&mut self) -> Option<f32> {
        self.whole().map(f32::from_bits).filter(|value| !value.is_nan())
    }

    /// Whether all were read.
    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }
}

/// A value that has a place in an image.
pub trait Layout: Copy {
    /// Gives its words in their order.
    fn put(&self, name: &'static str, sink: &mut impl Sink);

    /// Gives those of several.
    fn put_all(values: &[Self], name: &'static str, sink: &mut impl Sink) {
        sink.begin(name);
        for (at, value) in values.iter().enumerate() {
            sink.begin_place(at);
            value.put("", sink);
            sink.end();
        }
        sink.end();
    }

    /// Reads its words in the same order; `None` if they are too few, or cannot be such a value.
    fn take(words: &mut Words<'_>) -> Option<Self>;
}

impl Layout for f32 {
    fn put(&self, name: &'static str, sink: &mut impl Sink) {
        sink.reals(name, core::slice::from_ref(self));
    }

    fn put_all(values: &[Self], name: &'static str, sink: &mut impl Sink) {
        sink.reals(name, values);
    }

    fn take(words: &mut Words<'_>) -> Option<Self> {
        words.real()
    }
}

impl Layout for u32 {
    fn put(&self, name: &'static str, sink: &mut impl Sink) {
        sink.whole(name, *self);
    }

    fn take(words: &mut Words<'_>) -> Option<Self> {
        words.whole()
    }
}

impl Layout for usize {
    fn put(&self, name: &'static str, sink: &mut impl Sink) {
        sink.whole(name, *self as u32);
    }

    fn take(words: &mut Words<'_>) -> Option<Self> {
        words.whole().map(|word| word as usize)
    }
}

impl Layout for bool {
    fn put(&self, name: &'static str, sink: &mut impl Sink) {
        sink.whole(name, u32::from(*self));
    }

    fn take(words: &mut Words<'_>) -> Option<Self> {
        words.whole().filter(|word| *word <= 1).map(|word| word == 1)
    }
}

impl<L: Layout, const N: usize> Layout for [L; N] {
    fn put(&self, name: &'static str, sink: &mut impl Sink) {
        L::put_all(self, name, sink);
    }

    fn take(words: &mut Words<'_>) -> Option<Self> {
        let mut values = [L::take(words)?; N];
        for value in values.iter_mut().skip(1) {
            *value = L::take(words)?;
        }
        Some(values)
    }
}

impl<L: Layout> Layout for Option<L> {
    fn put(&self, name: &'static str, sink: &mut impl Sink) {
        sink.begin(name);
        self.is_some().put("given", sink);
        if let Some(value) = self {
            value.put("", sink);
        }
        sink.end();
    }

    fn take(words: &mut Words<'_>) -> Option<Self> {
        if bool::take(words)? { L::take(words).map(Some) } else { Some(None) }
    }
}
