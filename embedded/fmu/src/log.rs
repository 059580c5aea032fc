//! Messages to the program that runs the model.

use alloc::ffi::CString;
use core::ffi::{CStr, c_char, c_int, c_void};

/// Status of a function that failed.
pub(crate) const ERROR: c_int = 3;
const CATEGORY: &CStr = c"logStatusError";

/// The function for messages of FMI 2.0.
pub(crate) type Logger2 = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);
/// That of FMI 3.0.
pub(crate) type Logger3 = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

/// Where messages go.
pub(crate) enum Log {
    /// Nowhere.
    None,
    /// To a program with FMI 2.0.
    Two { logger: Logger2, environment: *mut c_void, name: CString },
    /// To a program with FMI 3.0.
    Three { logger: Logger3, environment: *mut c_void },
}

impl Log {
    /// Reports an error. The message has no `%`: FMI 2.0 takes it as a format.
    pub(crate) fn error(&self, message: &CStr) {
        let (category, message) = (CATEGORY.as_ptr(), message.as_ptr());
        // SAFETY: the functions are those of the standard, and all texts are strings of C that outlive the call.
        unsafe {
            match self {
                Self::None => {}
                Self::Two { logger, environment, name } => {
                    logger(*environment, name.as_ptr(), ERROR, category, message);
                }
                Self::Three { logger, environment } => logger(*environment, ERROR, category, message),
            }
        }
    }
}
