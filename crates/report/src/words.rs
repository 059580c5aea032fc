//! Sentences of a page: what was found, and warnings with their hints.

use minijinja::{HtmlEscape, Value, context};

/// What was found: sentences, and the warnings among them.
pub(crate) fn found(sentences: &[String]) -> Value {
    let is_warning = |sentence: &&String| sentence.starts_with(WARNING) || sentence.contains(HINT);
    let warnings = sentences.iter().filter(is_warning).map(|sentence| {
        let (text, hint) =
            sentence.split_once(HINT).map_or((sentence.as_str(), None), |(text, hint)| (text, Some(hint)));
        context! { text => marked(text.strip_prefix(WARNING).unwrap_or(text)), hint => hint.map(marked) }
    });
    let others = sentences.iter().filter(|sentence| !is_warning(sentence)).map(|sentence| marked(sentence));
    context! { warnings => warnings.collect::<Vec<_>>(), sentences => others.collect::<Vec<_>>() }
}

const WARNING: &str = "warning: ";
const HINT: &str = "\nhint: ";

/// A text with what stands between backticks as code.
fn marked(text: &str) -> Value {
    let mut html = String::new();
    let mut parts = text.split('`').enumerate().peekable();
    while let Some((at, part)) = parts.next() {
        let escaped = HtmlEscape(part);
        // The last part has no second backtick.
        html += &match (at % 2 == 1, parts.peek()) {
            (true, Some(_)) => format!("<code>{escaped}</code>"),
            (true, None) => format!("`{escaped}"),
            (false, _) => escaped.to_string(),
        };
    }
    Value::from_safe_string(html)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_between_backticks_is_code_and_all_is_text() {
        let html = |text: &str| marked(text).to_string();
        assert_eq!(html("give `lock_up` <b> with `a`"), "give <code>lock_up</code> &lt;b&gt; with <code>a</code>");
        assert_eq!(
            [html("one ` alone"), html(""), html("`<script>`")],
            ["one ` alone", "", "<code>&lt;script&gt;</code>"]
        );
    }

    #[test]
    fn a_warning_has_its_hint_and_other_sentences_stay() {
        let sentences =
            ["320 shifts.", "warning: a <b> is off\nhint: look at `b`", "a reading\nhint: check it"].map(str::to_owned);
        let found = found(&sentences);
        let warnings = found.get_attr("warnings").unwrap();
        assert_eq!((warnings.len(), found.get_attr("sentences").unwrap().len()), (Some(2), Some(1)));
        let first = warnings.get_item(&Value::from(0)).unwrap();
        assert_eq!(first.get_attr("text").unwrap().to_string(), "a &lt;b&gt; is off");
        assert_eq!(first.get_attr("hint").unwrap().to_string(), "look at <code>b</code>");
    }
}
