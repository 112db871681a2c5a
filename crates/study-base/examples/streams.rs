//! Reads two keys of a TOML text, reports its faults, and draws random numbers.
//!
//! `cargo run -p study-base --example streams`

use study_base::diagnostic::Findings;
use study_base::diagnostic::table::Document;
use study_base::rng::Stream;

const TEXT: &str = "seed = 2007\nrepetition = 3\n";

#[allow(clippy::print_stdout, reason = "an example prints")]
fn main() {
    let document = Document::parse(TEXT);
    let mut root = document.root();
    let seed = root.u32("seed").unwrap_or_default();
    let repetitions = root.u32("repetitions");
    root.finish();

    // The second key is misspelt: a fault with its line, and a suggestion.
    let mut findings = Findings::new("example.toml", TEXT);
    findings.faults = document.finish().faults;
    println!("{}repetitions = {repetitions:?}\n", findings.render(false));

    // The same seed and path give the same numbers, on every machine and for ever.
    for row in ["1", "2"] {
        let mut stream = Stream::new(seed.into(), &["example", row]);
        let mut order = ["A", "B", "C", "D", "E"];
        stream.shuffle(&mut order);
        println!("row {row}: {}, then {:.3}", order.join(" "), stream.unit());
    }
}
