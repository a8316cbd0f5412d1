//! Tables in Markdown pages, between marks that name what stands there.

/// The lines before and after a table.
#[must_use]
pub fn marks(name: &str) -> [String; 2] {
    ["begin", "end"].map(|end| format!("<!-- {name}: {end} -->"))
}

/// A page with what stands between the marks of `name` replaced; `None` if it has no such marks.
#[must_use]
pub fn insert(page: &str, name: &str, section: &str) -> Option<String> {
    let [begin, end] = marks(name);
    let (before, rest) = page.split_once(&begin)?;
    let (_, after) = rest.split_once(&end)?;
    Some(format!("{before}{begin}\n\n{section}\n{end}{after}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_takes_the_place_of_the_old_one() {
        let [begin, end] = marks("coverage");
        let page = format!("before\n{begin}\nold\n{end}\nafter\n");
        let new = insert(&page, "coverage", "new").unwrap_or_default();
        assert!(new.starts_with("before") && new.ends_with("after\n"));
        assert!(new.contains("new") && !new.contains("old"));
        assert_eq!(insert(&page, "likelihood", "new"), None);
    }
}
