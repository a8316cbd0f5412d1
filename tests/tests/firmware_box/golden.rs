//! Golden outputs, accepted once and compared from then on.

use std::fs;

use massline_tests::fixture;
use massline_tests::readme::{ACCEPT, accepts};

/// Compares with the fixture of this name, or writes it if [`ACCEPT`] is set.
pub fn compare(name: &str, found: &str) {
    let path = fixture("firmware").join(name);
    if accepts() {
        fs::create_dir_all(fixture("firmware")).expect("the folder can be made");
        fs::write(&path, found).expect("the fixture can be written");
        return;
    }
    let expected = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        found == expected,
        "{} differs from the box's output. If the new text is right, run this again with \
         {ACCEPT}=1 and commit the file.\nexpected:\n{expected}\nfound:\n{found}",
        path.display()
    );
}
