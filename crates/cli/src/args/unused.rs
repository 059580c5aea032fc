//! Options for all commands that change nothing with this one.

use super::{Arguments, Command};

/// An option that changes nothing, and why.
pub(crate) type WithoutEffect = (&'static str, &'static str);

impl Arguments {
    /// The options among those that were typed that change nothing. Units may also be those of the environment, for all commands alike.
    pub(crate) fn without_effect(&self, typed: &[String]) -> Vec<WithoutEffect> {
        let is_typed = |option: &str| typed.iter().any(|of| of.split('=').next() == Some(option));
        let units = if is_typed("--units") { self.command.shows_no_units() } else { None };
        let force = (self.force && !self.command.writes_files()).then_some("no file is written");
        [("--units", units), ("--force", force)].into_iter().filter_map(|(option, why)| Some((option, why?))).collect()
    }
}

impl Command {
    /// Why nothing is shown in units of choice.
    fn shows_no_units(&self) -> Option<&'static str> {
        match self {
            Self::Convert(_) | Self::Init(_) | Self::Export(_) | Self::Completions(_) | Self::Man(_) => {
                Some("files have SI units")
            }
            Self::Inspect(of) if !of.shifts => Some("channels have the units of the log"),
            Self::Compare(of)
                if of.output.is_none()
                    && [&of.a, &of.b].iter().all(|path| path.extension() == Some("toml".as_ref())) =>
            {
                Some("keys of files have SI units")
            }
            _ if self.prints_json() && !self.writes_page() => Some("JSON has SI units"),
            _ => None,
        }
    }

    fn prints_json(&self) -> bool {
        match self {
            Self::Demo(of) => of.json,
            Self::Simulate(of) => of.json,
            Self::Design(of) => of.json,
            Self::Inspect(of) => of.json,
            Self::Convert(of) => of.json,
            Self::Estimate(of) => of.json,
            Self::Fit(of) => of.json,
            Self::Init(of) => of.json,
            Self::Reproduce(of) => of.json,
            Self::Bench(of) => of.json,
            Self::Study(of) => of.json,
            Self::Merge(of) => of.json,
            Self::ErrorBound(of) => of.json,
            Self::Sensitivity(of) => of.json,
            Self::WorstCase(of) => of.json,
            Self::Compare(of) => of.json,
            Self::Check(of) => of.json,
            Self::Export(of) => of.json,
            Self::Watch(of) => of.json,
            Self::Completions(_) | Self::Man(_) => false,
        }
    }

    /// Whether a page or a figure is written.
    fn writes_page(&self) -> bool {
        match self {
            Self::Demo(_) | Self::Study(_) | Self::Merge(_) | Self::Reproduce(_) | Self::WorstCase(_) => true,
            Self::Estimate(of) => of.output.is_some(),
            Self::Inspect(of) => of.output.is_some(),
            Self::Compare(of) => of.output.is_some(),
            Self::Bench(of) => of.output.is_some(),
            Self::ErrorBound(of) => of.output.is_some(),
            Self::Sensitivity(of) => of.output.is_some(),
            Self::Check(of) => of.output.is_some() || of.page.page.is_some(),
            Self::Design(of) => of.page.page.is_some(),
            Self::Fit(of) => of.page.page.is_some(),
            Self::Simulate(_) | Self::Convert(_) | Self::Init(_) | Self::Export(_) => false,
            Self::Watch(_) | Self::Completions(_) | Self::Man(_) => false,
        }
    }

    fn writes_files(&self) -> bool {
        match self {
            Self::Simulate(_) | Self::Convert(_) | Self::Init(_) | Self::Export(_) | Self::Fit(_) | Self::Man(_) => {
                true
            }
            Self::Estimate(of) => of.output.is_some() || of.learnt.is_some(),
            Self::Inspect(of) => of.output.is_some() || of.write_converter.is_some(),
            _ => self.writes_page(),
        }
    }
}
