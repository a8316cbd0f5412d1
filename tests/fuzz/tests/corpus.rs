//! Repeats every input of the folder `corpus`, target by target.

use massline_fuzz::{TARGETS, seeds};
use std::fs;
use std::path::{Path, PathBuf};

fn folder(target: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("corpus")
        .join(target)
}

/// Most bytes of a target's inputs in the repository.
const MOST: u64 = 100_000;

#[test]
fn every_input_of_the_corpora_passes() {
    for (target, run) in TARGETS {
        let mut sizes = Vec::new();
        for entry in fs::read_dir(folder(target)).unwrap() {
            let path = entry.unwrap().path();
            let bytes = fs::read(&path).unwrap();
            // The output of a failed test names the input.
            println!("{}", path.display());
            run(&bytes);
            sizes.push(bytes.len() as u64);
        }
        let sum: u64 = sizes.iter().sum();
        assert!(sizes.len() > 1 && sum <= MOST, "{target}: {sum} bytes");
    }
}

#[test]
fn seeds_keep_every_promise() {
    for (target, run) in TARGETS {
        let seeds = seeds::of(target);
        assert!(!seeds.is_empty(), "{target}");
        seeds.iter().for_each(|seed| run(seed));
    }
}

/// Writes the seeds into a folder, for `cargo xtask fuzz`.
#[test]
#[ignore = "writes files: cargo xtask fuzz names the folder"]
fn write_seeds() {
    let into = std::env::var_os("MASSLINE_FUZZ_SEEDS").expect("MASSLINE_FUZZ_SEEDS names a folder");
    for (target, _) in TARGETS {
        let folder = Path::new(&into).join(target);
        fs::create_dir_all(&folder).unwrap();
        for (number, seed) in seeds::of(target).iter().enumerate() {
            fs::write(folder.join(format!("seed-{number}")), seed).unwrap();
        }
    }
}
