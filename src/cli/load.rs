//! Opens a protocol and everything it names, and joins them.
