//! Links the examples for a processor without an operating system with their memory map.

use std::env;

fn main() {
    println!("cargo:rerun-if-changed=examples/stm32f4/link.ld");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("none") {
        let folder = env::var("CARGO_MANIFEST_DIR").unwrap_or_default();
        println!("cargo:rustc-link-arg-examples=-T{folder}/examples/stm32f4/link.ld");
    }
}
