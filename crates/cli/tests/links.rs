//! Links between the pages of the documentation, and its size.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::support::ROOT;

/// All pages below a folder.
fn pages(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let nested = entries.map(|path| match path.extension() {
        _ if path.is_dir() => pages(&path),
        Some(end) if end == "md" => vec![path],
        _ => Vec::new(),
    });
    nested.flatten().collect()
}

/// The places of a page that a link can name: its headings, as they are written in a link, and explicit ones.
fn anchors(page: &str) -> BTreeSet<String> {
    let headings = page.lines().filter(|line| line.starts_with('#')).map(|line| {
        let title = line.trim_start_matches('#').trim().to_lowercase().replace(' ', "-");
        title.chars().filter(|sign| sign.is_alphanumeric() || matches!(sign, '-' | '_')).collect()
    });
    let explicit = page.split("<a id=\"").skip(1).filter_map(|rest| rest.split_once('"')).map(|(id, _)| id.to_owned());
    headings.chain(explicit).collect()
}

#[test]
fn every_link_between_pages_leads_to_a_file_and_a_place_in_it() {
    let root = PathBuf::from(ROOT);
    let all = [pages(&root.join("docs")), vec![root.join("README.md"), root.join("CONTRIBUTING.md")]].concat();
    assert!(all.len() > 15);
    let mut broken = Vec::new();
    for page in all {
        let text = std::fs::read_to_string(&page).unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(link, _)| link) {
            if link.contains("://") || link.contains(' ') {
                continue;
            }
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if path.is_empty() { page.clone() } else { page.with_file_name(path) };
            let is_page = target.extension().is_some_and(|end| end == "md");
            let leads = target.exists()
                && (anchor.is_empty()
                    || !is_page
                    || anchors(&std::fs::read_to_string(&target).unwrap()).contains(anchor));
            if !leads {
                broken.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

/// The words of a page that somebody wrote: none of a code block or of the target of a link, and no numbers and signs.
fn words(page: &str) -> usize {
    let prose = page.split("```").step_by(2).collect::<String>();
    let (first, links) = prose.split_once("](").unwrap_or((&prose, ""));
    let after = links.split("](").map(|rest| rest.split_once(')').map_or("", |(_, after)| after));
    let text = std::iter::once(first).chain(after).collect::<Vec<_>>().join("] ");
    text.split_whitespace().filter(|word| word.contains(char::is_alphabetic)).count()
}

/// Longer documentation is read by nobody. Pages that a program writes, and the index of equations, which a test compares with the code, are apart.
#[test]
fn the_written_pages_have_at_most_25_000_words() {
    let mut all = 0;
    for path in pages(&PathBuf::from(ROOT).join("docs")) {
        let page = std::fs::read_to_string(&path).unwrap();
        if !page.starts_with("<!-- Written by") && !path.ends_with("reference/equations.md") {
            all += words(&page);
        }
    }
    assert!((10_000..=25_000).contains(&all), "{all} words");
}
