//! The page of an estimate that goes on: it takes its rows from the server that it comes from.

use minijinja::context;

use crate::page::{PLOTS, PLOTS_STYLE, PageError, templates};

/// The page with this title. `settings` is JSON: `window`, the seconds that it shows, and `panels`, each with `label`, `decimals` and `curves` that
/// have a `name` and their place `at` in a sample. The server gives `/rows`, a stream of events.
///
/// # Errors
/// None in a released program; the tests render the template.
pub fn live_page(title: &str, settings: &str) -> Result<String, PageError> {
    let context = context! { title, settings, version => env!("CARGO_PKG_VERSION") };
    let html = templates()?.get_template("watch.html")?.render(context)?;
    let parts = [
        ("/* uPlot.min.css */", PLOTS_STYLE),
        ("/* uPlot.iife.min.js */", PLOTS),
        ("/* watch.js */", include_str!("page/watch.js")),
    ];
    Ok(parts.into_iter().fold(html, |html, (place, part)| html.replacen(place, part, 1)))
}

#[cfg(test)]
mod tests {
    use super::live_page;

    #[test]
    fn names_are_text_and_all_scripts_are_in_the_page() {
        let html = live_page("<script>alert(1)</script>.csv", r#"{"window":10,"panels":[]}"#).unwrap();
        assert!(!html.contains("<script>alert") && html.contains("&lt;script&gt;alert(1)"), "{html}");
        assert!(html.contains("uPlot=function") && html.contains("EventSource"));
        assert!(!html.contains("http://") || !html.contains("src="), "the page asks no other server");
    }
}
