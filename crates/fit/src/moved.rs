//! Paths in a file that is written to another folder.

use std::path::{Component, Path, PathBuf};

use trace::toml_string;

/// How the file `to` names another that `from` names too, each from its own folder, as a string in TOML; none where `from` is in the same folder, or the
/// named file is not there.
pub(crate) fn moved(named: &Path, from: &Path, to: &Path) -> Option<String> {
    let folder = |path: &Path| match path.parent() {
        Some(folder) if folder != Path::new("") => folder.to_owned(),
        _ => PathBuf::from("."),
    };
    let whole = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let (from, to) = (whole(&folder(from)), whole(&folder(to)));
    (from != to && named.exists())
        .then(|| toml_string(&relative(&to, &whole(named)).to_string_lossy().replace('\\', "/")))
}

/// The way from a folder to a file, both from the root; the file itself where there is none.
fn relative(folder: &Path, file: &Path) -> PathBuf {
    let common = folder.components().zip(file.components()).take_while(|(one, other)| one == other).count();
    // On another drive.
    if !matches!(folder.components().nth(common.saturating_sub(1)), Some(Component::RootDir | Component::Normal(_))) {
        return file.to_owned();
    }
    let up = folder.components().skip(common).map(|_| Component::ParentDir);
    up.chain(file.components().skip(common)).collect()
}
