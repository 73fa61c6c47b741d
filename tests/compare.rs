//! `dualux compare` as a user meets it: table, JSON, a page that needs nothing from elsewhere, messages.

#[path = "common/cli.rs"]
mod cli;

use cli::{dualux_in, scene};
use std::path::{Path, PathBuf};
use std::process::Output;

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A comparison of a small Cornell box, with these arguments beside.
fn compare(folder: &Path, args: &[&str]) -> Output {
    let scene = scene("cornell-box.xml");
    let mut words = vec!["compare", &scene, "--scale", "0.06", "-o", "r.html", "--json", "r.json"];
    words.extend(args);
    dualux_in(folder, &words)
}

fn json(folder: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(folder.join("r.json")).expect("written")).expect("JSON")
}

fn number(value: &serde_json::Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("a number, not {value}"))
}

const SHALLOW: [&str; 8] = [
    "--config",
    "full: --integrator path",
    "--config",
    "shallow: --integrator path --max-depth 3",
    "--equal",
    "passes",
    "--reference-budget",
    "128",
];

#[test]
fn table_json_and_page_tell_the_same() {
    let dir = tempfile::tempdir().expect("scratch folder");
    let mut args = SHALLOW.to_vec();
    args.extend(["--budget", "12", "--seeds", "4"]);
    let out = compare(dir.path(), &args);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(text(&out.stderr).contains("two halves"), "the reference is spoken of");
    let table = text(&out.stdout);
    let json = json(dir.path());
    assert_eq!((json["width"].as_u64(), json["equal"].as_str()), (Some(31), Some("passes")));
    assert!(number(&json["reference"]["self_error"]) > 0.0 && json["reference"]["halves"] == true);

    let [full, shallow] = [&json["configurations"][0], &json["configurations"][1]];
    for c in [full, shallow] {
        assert_eq!(number(&c["passes"]), 12.0);
        assert_eq!(number(&c["samples"]), 12.0 * 31.0 * 31.0);
        let passes: Vec<u64> = c["curve"].as_array().unwrap().iter().map(|p| p["passes"].as_u64().unwrap()).collect();
        assert_eq!(passes, [1, 2, 4, 8, 12]);
        let split = &c["relmse"];
        let sum = number(&split["bias_sq"]) + number(&split["variance"]);
        assert!((sum - number(&split["mean"])).abs() < 1e-9 && split["runs"].as_array().unwrap().len() == 4);
        assert!(number(&c["cpu_seconds"]["mean"]) > 0.0 && number(&c["rays"]) > 0.0);
        assert!(table.contains(&format!("{:.2e}", number(&split["mean"]))), "{table}");
    }
    // Two bounces instead of all: a tenth of the light is missing, which is bias and not noise.
    assert!(number(&shallow["relmse"]["bias_sq"]) > 5.0 * number(&shallow["relmse"]["bias_sq_error"]));
    assert!(number(&full["relmse"]["bias_sq"]).abs() < 0.2 * number(&shallow["relmse"]["bias_sq"]));
    assert!(number(&shallow["rays"]) < number(&full["rays"]));
    assert!(number(&shallow["speed_up"]["ratio"]) > 0.0 && full["speed_up"].is_null());

    page_is_self_contained(&dir.path().join("r.html"), 3);
}

/// The page is well-formed, asks nothing of the network, and holds `pictures` pictures beside its maps.
fn page_is_self_contained(path: &Path, pictures: usize) {
    let page = std::fs::read_to_string(path).expect("the report");
    for word in ["http:", "https:", "src=", "@import", "<link", "fetch(", "XMLHttp"] {
        assert!(!page.contains(word), "{word} in the page");
    }
    // Every address of a style is a picture within the page.
    for address in page.match_indices("url(").map(|(at, _)| &page[at + 4..]) {
        assert!(address.starts_with("data:image/png;base64,"), "{}", &address[..40]);
    }
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    let doc = roxmltree::Document::parse_with_options(&page, options).expect("well-formed");
    let count = |tag: &str| doc.descendants().filter(|n| n.has_tag_name(tag)).count();
    assert_eq!((count("html"), count("table"), count("script"), count("select")), (1, 1, 1, 2));
    assert_eq!(count("option"), 2 * pictures);
    assert!(count("svg") >= 1 && count("path") > 4);
    let shown = |i: usize| page.contains(&format!(".p{i} {{ background-image"));
    assert!(shown(0) && shown(pictures - 1) && !shown(pictures));
}

#[test]
fn equal_time_ends_on_time_and_references_can_be_files() {
    let dir = tempfile::tempdir().expect("scratch folder");
    let scene = scene("cornell-box.xml");
    for (file, seed) in [("a.exr", "11"), ("b.exr", "12")] {
        let made = [
            "render",
            &scene,
            "--integrator",
            "path",
            "--scale",
            "0.06",
            "--spp",
            "64",
            "--seed",
            seed,
            "-o",
            file,
            "-q",
        ];
        assert!(dualux_in(dir.path(), &made).status.success());
    }
    let configs = ["--config", "one: --integrator path --seed 3", "--config", "two: --integrator path --seed 40"];
    let mut args = configs.to_vec();
    args.extend(["--budget", "300ms", "--seeds", "2", "--reference", "a.exr", "b.exr", "-q"]);
    let out = compare(dir.path(), &args);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(text(&out.stdout).contains("a.exr and b.exr"));
    let json = json(dir.path());
    for c in json["configurations"].as_array().unwrap() {
        let cpu = number(&c["cpu_seconds"]["mean"]);
        // One tile more per thread at most; the machine may be busy, but CPU time does not know.
        assert!((0.299..0.5).contains(&cpu), "{cpu}");
        assert!(number(&c["passes"]) >= 1.0);
    }
    let seeds = |c: usize| -> Vec<u64> {
        let runs = json["configurations"][c]["runs"].as_array().unwrap();
        runs.iter().map(|r| r["seed"].as_u64().unwrap()).collect()
    };
    assert_eq!((seeds(0), seeds(1)), (vec![3, 4], vec![40, 41]));
    // The same method twice: the truth, a speed-up of 1, is not thrown out.
    let ratio = number(&json["configurations"][1]["speed_up"]["ratio"]);
    assert!((0.3..3.0).contains(&ratio), "{ratio}");
}

#[test]
fn the_same_passes_give_the_same_numbers_on_any_number_of_threads() {
    let errors = |threads: &str| -> Vec<f64> {
        let dir = tempfile::tempdir().expect("scratch folder");
        let mut args = SHALLOW.to_vec();
        args.extend(["--budget", "3", "--seeds", "2", "-t", threads, "-q"]);
        assert!(compare(dir.path(), &args).status.success());
        let json = json(dir.path());
        let split = |i: usize| number(&json["configurations"][i]["relmse"]["bias_sq"]);
        vec![split(0), split(1), number(&json["configurations"][0]["relmse"]["mean"])]
    };
    assert_eq!(errors("1"), errors("3"));
}

#[test]
fn mistakes_are_explained() {
    let dir = tempfile::tempdir().expect("scratch folder");
    let cases: [(&[&str], i32, &str); 10] = [
        (&["--config", "a: --max-dept 3"], 2, "--max-depth"),
        (&["--config", "no colon"], 2, "name: flags"),
        (&["--config", "a: -o x.exr"], 2, "--output"),
        (&["--config", "a:", "--seeds", "0"], 2, "--seeds"),
        (&["--config", "a:", "--config", "a: --spp 3"], 1, "two configurations"),
        (&["--config", "a:", "--equal", "passes", "--budget", "3s"], 1, "number of passes"),
        (&["--config", "a:", "--config", "b: --scale 0.1", "--reference-budget", "1"], 1, "another size"),
        (&["--config", "a:", "--reference", "missing.exr"], 1, "missing.exr"),
        (&["--config", "a: -D nonsense=1"], 1, "nonsense"),
        (
            &["--config", "a: --integrator path", "--equal", "photons", "--seeds", "1", "--reference-budget", "1"],
            1,
            "no photon",
        ),
    ];
    for (args, code, part) in cases {
        let out = compare(dir.path(), args);
        let stderr = text(&out.stderr);
        assert_eq!(out.status.code(), Some(code), "{args:?}: {stderr}");
        assert!(stderr.contains(part) && stderr.contains("error"), "{args:?}: {stderr}");
    }
    let scene = scene("cornell-box.xml");
    for bad in [["-o", "x.png"], ["-o", "/no/such/folder/x.html"], ["--json", "/no/such/folder/x.json"]] {
        let out = dualux_in(dir.path(), &["compare", &scene, "--config", "a:", bad[0], bad[1]]);
        assert_eq!(out.status.code(), Some(1), "{bad:?}: {}", text(&out.stderr));
    }
    let left: Vec<PathBuf> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().path()).collect();
    assert!(left.is_empty(), "nothing is written: {left:?}");
}
