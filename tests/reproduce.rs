//! `dualux reproduce` as a user meets it: figures by name, and clear words where something cannot be run.

#[path = "common/cli.rs"]
mod cli;

use cli::{dualux_in, scene, stderr};

#[test]
fn figures_of_namae_makino_are_there_or_their_absence_is_explained() {
    let dir = tempfile::tempdir().expect("scratch folder");
    let (spheres, ring) = (scene("cornell-spheres.xml"), scene("caustic-ring.xml"));
    let mut args = vec!["reproduce", "namae-makino", &spheres, "--caustic-scene", &ring, "--scale", "0.04", "-q"];
    args.extend(["--budget", "60ms", "--seeds", "2", "--json", "r.json", "-o", "."]);
    let out = dualux_in(dir.path(), &args);
    let said = stderr(&out);
    assert!(!said.contains("panicked"), "{said}");
    if !out.status.success() {
        // A version without the flags that the paper needs says which ones.
        assert_eq!(out.status.code(), Some(1));
        assert!(said.contains("cannot be run") && said.contains("nothing of namae-makino"), "{said}");
        assert!(said.contains("'--"), "the unknown flag is named: {said}");
        return;
    }
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(dir.path().join("r.json")).unwrap()).unwrap();
    let unavailable = json["unavailable"].as_object().expect("an object");
    for (key, experiment) in [
        ("speedup_all", "ablation"),
        ("light_share", "shares"),
        ("aa_share", "shares"),
        ("photon_error_ratio_at_one_fifth", "photons"),
        ("caustic_relmse_gain_equal_time", "caustic"),
    ] {
        let value = json.get(key).unwrap_or_else(|| panic!("{key} in the file"));
        if unavailable.contains_key(experiment) {
            assert!(value.is_null(), "{key}: {value}");
        } else {
            assert!(value.is_null() || value.as_f64().is_some_and(|v| v >= 0.0), "{key}: {value}");
            let page = dir.path().join(format!("namae-makino-{experiment}.html"));
            assert!(page.exists(), "a report of {experiment}");
        }
    }
    let table = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(table.contains("doubtful in the paper: 15,538"), "{table}");
}

#[test]
fn figures_of_nabata_are_there_and_missing_scenes_are_told() {
    // A folder with one of the paper's scenes only.
    let dir = tempfile::tempdir().expect("scratch folder");
    std::fs::create_dir(dir.path().join("scenes")).expect("a folder");
    std::fs::copy(scene("cornell-box.xml"), dir.path().join("scenes/cornell-box.xml")).expect("a copy");
    let args = ["reproduce", "nabata", "--scale", "0.1", "--seeds", "2", "--budget", "100ms", "-q", "--json", "r.json"];
    let out = dualux_in(dir.path(), &args);
    assert!(out.status.success(), "{}", stderr(&out));
    assert!(stderr(&out).contains("hairball-lite cannot be run"), "{}", stderr(&out));
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(dir.path().join("r.json")).unwrap()).unwrap();
    let figure = |key: &str| json[key].as_f64().unwrap_or_else(|| panic!("{key}: {}", json[key]));
    // The clamp at a tenth is what saves rays: between it and what is checked for certain.
    assert!((0.5..=0.9).contains(&figure("nabata_saved_of_possible")), "{}", figure("nabata_saved_of_possible"));
    // As the paper counts, a tenth of the lights that cannot contribute are asked too; Veach's rule asks none.
    assert!((0.5..=0.9).contains(&figure("nabata_saved_rays")), "{}", figure("nabata_saved_rays"));
    assert!(figure("veach_saved_rays") > figure("veach_saved_of_possible") + 0.05);
    assert!(figure("joint_gain_over_nabata").is_finite() && figure("joint_gain_over_veach").is_finite());
    assert!(json["unavailable"]["staircase2"].is_string());
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(text.contains("at the floor") && text.contains("rays over all else"), "{text}");
}

#[test]
fn a_moved_light_of_yue_takes_no_gather_ray_and_a_moved_camera_few_records() {
    let dir = tempfile::tempdir().expect("scratch folder");
    let spheres = scene("cornell-spheres.xml");
    let out =
        dualux_in(dir.path(), &["reproduce", "yue", &spheres, "--scale", "0.1", "-q", "--json", "r.json", "-o", "."]);
    assert!(out.status.success(), "{}", stderr(&out));
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(dir.path().join("r.json")).unwrap()).unwrap();
    assert_eq!(json["moved_light_gather_rays"], 0.0);
    let scenes = json["scenes"].as_array().expect("scenes");
    assert_eq!(scenes.len(), 2);
    for s in scenes {
        // The light was evaluated, and by rays of its own; the count of gather rays is one that can grow.
        assert!(
            s["gather_rays"].as_u64().unwrap() > 10_000 && s["moved_light_shadow_rays"].as_u64().unwrap() > 1000,
            "{s}"
        );
        let difference = s["moved_light_difference"].as_f64().unwrap();
        assert!(difference > 0.0 && difference < 0.3, "{s}");
    }
    let share = json["moved_camera_new_records_share"].as_f64().unwrap();
    assert!((0.0..0.25).contains(&share), "{share}");
    let table = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(table.contains("moved light / moved camera") && table.contains("2.08"), "{table}");
    assert!(dir.path().join("yue.html").exists());
}

#[test]
fn mistakes_are_explained() {
    let dir = tempfile::tempdir().expect("scratch folder");
    let spheres = scene("cornell-spheres.xml");
    let cases: [(&[&str], i32, &str); 6] = [
        (&["reproduce"], 2, "PAPER"),
        (&["reproduce", "kajiya"], 2, "namae-makino"),
        (&["reproduce", "namae-makino", "--seeds", "0"], 2, "--seeds"),
        (&["reproduce", "namae-makino", "no-such.xml"], 1, "no-such.xml"),
        (&["reproduce", "namae-makino", &spheres, "-o", "no-folder"], 1, "no-folder"),
        (&["reproduce", "namae-makino", &spheres, "--json", "no-folder/x.json"], 1, "no-folder"),
    ];
    for (args, code, part) in cases {
        let out = dualux_in(dir.path(), args);
        assert_eq!(out.status.code(), Some(code), "{args:?}: {}", stderr(&out));
        assert!(stderr(&out).contains(part), "{args:?}: {}", stderr(&out));
    }
}
