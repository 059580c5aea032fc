//! `--page`: what a command prints, as a page with figures.

use std::path::PathBuf;

use report::sheet::Sheet;
use trace::ShownPath as _;

use super::written::{is_page, replaces_only};
use super::{check_output, not_an_input, write_text};
use crate::args::PageChoice;
use crate::browser;
use crate::failure::Failure;
use crate::output;

/// Refuses a page that cannot be written, or that would replace an input or a file of another kind, before the work starts.
pub(super) fn check_page<'a>(
    choice: &PageChoice,
    inputs: impl IntoIterator<Item = &'a PathBuf>,
) -> Result<(), Failure> {
    check_output(choice.page.as_ref())?;
    not_an_input(choice.page.as_ref(), inputs)?;
    choice.page.as_deref().map_or(Ok(()), |page| replaces_only("page in HTML", page, is_page))
}

/// Writes the page if one is wanted, says where it is, and opens it.
pub(super) fn write_page<'a>(choice: &PageChoice, sheet: impl FnOnce() -> Sheet<'a>) -> Result<(), Failure> {
    if choice.page.is_none() {
        return Ok(());
    }
    write_html(choice, &sheet().html()?)
}

/// Writes the text of a page where one is wanted, says where it is, and opens it.
pub(super) fn write_html(choice: &PageChoice, html: &str) -> Result<(), Failure> {
    let Some(page) = &choice.page else { return Ok(()) };
    write_text(page, html)?;
    output::note(&format!("page: {}", page.shown()));
    browser::open_if(choice.is_opened, page);
    Ok(())
}
