//! What can be doubted about a readable protocol.
