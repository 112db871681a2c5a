//! Every screen as a picture of its cells.

#[path = "tui_support/views.rs"]
mod support;

use support::*;

#[test]
fn every_screen_at_eighty_by_twenty_four() {
    for (name, view) in screens() {
        insta::assert_snapshot!(format!("{name}_80x24"), fresh(&view, 80, 24));
    }
}
