//! The house: which crate knows which, and that data flows one way within each.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// A module's path, such as `["instrument", "setup"]`.
type Module = Vec<String>;

/// Text of a source file without comments and without its tests.
fn code(file: &Path) -> String {
    let text = fs::read_to_string(file).expect("a source file");
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or("");
    let lines = text
        .lines()
        .map(|line| line.split("//").next().unwrap_or(""));
    lines.collect::<Vec<_>>().join("\n")
}

/// Modules below a folder that have a file of their own.
fn modules(folder: &Path, module: &Module, found: &mut BTreeMap<Module, String>) {
    for entry in fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("a readable folder").path();
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let mut child = module.clone();
        if !["mod", "lib", "main"].contains(&&*name) {
            child.push(name.into_owned());
        }
        if path.is_dir() {
            modules(&path, &child, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.entry(child).or_default().push_str(&code(&path));
        }
    }
}

/// Paths of a `use` tree, or the one path that begins a text.
fn paths(text: &str, prefix: &[String], found: &mut Vec<Module>) -> usize {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut path = prefix.to_vec();
    let mut at = 0;
    loop {
        let rest = &text[at..];
        let word = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
        if word > 0 {
            path.push(rest[..word].to_owned());
            at += word;
        } else if rest.starts_with('{') {
            at += 1;
            loop {
                at += text[at..].len() - text[at..].trim_start_matches([' ', '\n', ',']).len();
                if text[at..].is_empty() || text[at..].starts_with('}') {
                    return (at + 1).min(text.len());
                }
                at += paths(&text[at..], &path, found).max(1);
            }
        }
        if !text[at..].starts_with("::") {
            found.push(path);
            return at;
        }
        at += 2;
    }
}

/// Modules that a module names, of those that have a file.
fn named(module: &Module, text: &str, all: &BTreeMap<Module, String>) -> BTreeSet<Module> {
    let mut found = Vec::new();
    for start in ["crate::", "super::"] {
        for (at, _) in text.match_indices(start) {
            let before = text[..at].chars().next_back();
            if before.is_none_or(|c| !c.is_alphanumeric() && c != '_' && c != ':') {
                paths(&text[at..], &[], &mut found);
            }
        }
    }
    let resolve = |path: Module| {
        let mut place = module.clone();
        let mut path = path.into_iter().peekable();
        while let Some(step) = path.next_if(|step| ["crate", "super", "self"].contains(&&**step)) {
            match &*step {
                "crate" => place.clear(),
                "super" => drop(place.pop()),
                _ => {}
            }
        }
        place.extend(path);
        while !all.contains_key(&place) && place.pop().is_some() {}
        place
    };
    // A module and its own children may know each other.
    let is_family = |other: &Module| other.starts_with(module) || module.starts_with(other);
    let named = found.into_iter().map(resolve);
    named.filter(|other| !is_family(other)).collect()
}

/// Modules that lie on a circle of files.
fn circles(folder: &str) -> Vec<String> {
    let mut all = BTreeMap::new();
    modules(Path::new(folder), &Vec::new(), &mut all);
    assert!(all.len() > 10, "{folder} has few modules");
    let graph: BTreeMap<_, _> = all
        .iter()
        .map(|(m, text)| (m, named(m, text, &all)))
        .collect();
    let reaches_itself = |start: &Module| {
        let mut seen = BTreeSet::new();
        let mut next: Vec<&Module> = graph[start].iter().collect();
        while let Some(module) = next.pop() {
            if seen.insert(module) {
                next.extend(&graph[module]);
            }
        }
        seen.contains(start)
    };
    let circular = all.keys().filter(|module| reaches_itself(module));
    circular.map(|module| module.join("::")).collect()
}

/// Folders, or files that stand alone, right below a folder of sources that lie on a circle of such.
/// `entries` are where a program begins: like `main`, they know what lies around them.
fn circular_folders(folder: &str, entries: &[&str]) -> Vec<String> {
    let mut all = BTreeMap::new();
    modules(Path::new(folder), &Vec::new(), &mut all);
    let mut graph: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (module, text) in &all {
        let is_test = module.iter().any(|part| part == "tests");
        let (Some(from), false) = (module.first(), is_test) else {
            continue;
        };
        let known = graph.entry(from.clone()).or_default();
        if !entries.contains(&&*module.join("::")) {
            let tops = named(module, text, &all).into_iter();
            known.extend(tops.filter_map(|other| other.into_iter().next()));
        }
        known.remove(from);
    }
    let reaches_itself = |start: &String| {
        let mut seen = BTreeSet::new();
        let mut next: Vec<&String> = graph[start].iter().collect();
        while let Some(top) = next.pop() {
            if seen.insert(top) {
                next.extend(graph.get(top).into_iter().flatten());
            }
        }
        seen.contains(start)
    };
    graph
        .keys()
        .filter(|top| reaches_itself(top))
        .cloned()
        .collect()
}

/// Crates of this workspace among the dependencies of a manifest, those of its tests left out.
fn dependencies(manifest: &str) -> Vec<&str> {
    let own = manifest.split("dev-dependencies]").next().unwrap_or("");
    let names = own.lines().filter_map(|line| line.split([' ', '.']).next());
    let ours = |name: &&str| ["massline", "massline-core", "massline-firmware"].contains(name);
    names.filter(ours).collect()
}

#[test]
fn core_knows_nobody_the_box_knows_core_the_host_knows_both() {
    assert!(dependencies(include_str!("../../core/Cargo.toml")).is_empty());
    let of_box = dependencies(include_str!("../../firmware/Cargo.toml"));
    assert_eq!(of_box, ["massline-core"]);
    let of_host = dependencies(include_str!("../../host-tools/Cargo.toml"));
    assert_eq!(of_host, ["massline-core", "massline-firmware"]);
}

#[test]
fn no_circle_of_files_but_a_module_and_its_children() {
    for folder in ["../core/src", "../firmware/src", "../host-tools/src"] {
        assert_eq!(circles(folder), [""; 0], "{folder}");
    }
}

#[test]
fn no_circle_of_folders() {
    let folders = [
        ("../core/src", &[][..]),
        ("../firmware/src", &["board::tasks"]),
        ("../host-tools/src", &[]),
    ];
    for (folder, entries) in folders {
        assert_eq!(circular_folders(folder, entries), [""; 0], "{folder}");
    }
}

#[test]
fn the_board_alone_names_its_chip() {
    let mut all = BTreeMap::new();
    modules(Path::new("../firmware/src"), &Vec::new(), &mut all);
    for (module, text) in all {
        let is_board = module.first().is_some_and(|first| first == "board");
        let is_named = ["stm32f4", "::pac::"]
            .iter()
            .any(|name| text.contains(name));
        assert!(
            is_board || !is_named,
            "{} names the chip",
            module.join("::")
        );
    }
}

/// The search finds a circle where there is one.
/// The table of the README has a row for each file and folder of tests, but for what tests share.
#[test]
fn the_table_of_tests_is_whole() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let readme = std::fs::read_to_string(root.join("README.md")).unwrap();
    let rows: Vec<&str> = readme
        .lines()
        .filter(|line| line.starts_with("| `"))
        .collect();
    let mut seen = 0;
    for entry in std::fs::read_dir(root.join("tests")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if ["bench", "stand_in", "identical"].contains(&name.as_str()) {
            continue;
        }
        let has = rows.iter().any(|row| row.contains(&format!("`{name}")));
        assert!(has, "README.md has no row for {name}");
        seen += 1;
    }
    assert!(seen > 10);
}

#[test]
fn a_circle_is_found() {
    let all: BTreeMap<Module, String> = [
        ("a", "use crate::b::{c::Thing, Other};"),
        ("b", "mod c;"),
        ("b::c", "fn f(x: super::super::a::Thing) {}"),
    ]
    .into_iter()
    .map(|(m, text)| (m.split("::").map(str::to_owned).collect(), text.to_owned()))
    .collect();
    let to = |m: &str| m.split("::").map(str::to_owned).collect::<Module>();
    let of = |m: &str| named(&to(m), &all[&to(m)], &all);
    assert_eq!(of("a"), [to("b"), to("b::c")].into());
    assert_eq!(of("b::c"), [to("a")].into());
    assert!(of("b").is_empty());
}
