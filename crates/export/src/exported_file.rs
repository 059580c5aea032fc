//! Files that an export gives to its caller.

/// A file that is to be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExportedFile {
    /// Its name, without a folder.
    pub name: String,
    /// Its content.
    pub bytes: Vec<u8>,
}

impl ExportedFile {
    pub(crate) fn text(name: String, text: String) -> Self {
        Self { name, bytes: text.into_bytes() }
    }
}
