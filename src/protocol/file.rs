//! Reading a protocol file.
