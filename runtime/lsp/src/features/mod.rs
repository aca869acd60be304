//! What an editor asks for, a file each.

pub(crate) mod actions;
pub(crate) mod complete;
pub(crate) mod diagnostics;
pub(crate) mod docs;
pub(crate) mod format;
pub(crate) mod hints;
pub(crate) mod hover;
pub(crate) mod navigate;
pub(crate) mod outline;
pub(crate) mod rename;
pub(crate) mod signature;
pub(crate) mod tokens;
