//! The program as a user meets it: files, exit codes, messages, limits.

#[path = "common/cli.rs"]
mod cli;

use cli::{dualux, scene, scratch, stderr, stdout};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

#[test]
fn renders_png_and_exr_with_layers() {
    let (dir, exr) = scratch("a.exr");
    let png = dir.path().join("a.png");
    let (exr, png) = (exr.to_str().unwrap(), png.to_str().unwrap());
    let aov = "albedo,normal,depth,shape,variance,samples";
    let scene = scene("cornell-spheres.xml");
    let out = dualux(&["render", &scene, "-o", exr, "-o", png, "--scale", "0.1", "--spp", "2", "--aov", aov]);
    assert!(out.status.success(), "{}", stderr(&out));
    assert!(stdout(&out).contains("2 passes"));
    let picture = dualux::image::read_image(Path::new(exr)).expect("readable");
    assert_eq!((picture.width(), picture.height()), (30, 45));
    assert!(picture.pixels.iter().any(|p| p.x > 0.0));
    let names = exr_channels(Path::new(exr));
    let expected = ["R", "albedo.G", "normal.Z", "depth.Z", "shape.I", "variance.B", "samples.N"];
    for name in expected {
        assert!(names.contains(&name.to_string()), "{name} in {names:?}");
    }
    assert!(std::fs::metadata(png).expect("written").len() > 100);
}

fn exr_channels(path: &Path) -> Vec<String> {
    let meta = exr::meta::MetaData::read_from_file(path, false).expect("EXR");
    meta.headers[0].channels.list.iter().map(|c| c.name.to_string()).collect()
}

#[test]
fn wrong_command_lines_exit_with_2_and_bad_scenes_with_1() {
    let cornell = scene("cornell-box.xml");
    for args in [
        &["render"][..],
        &["rendr", "x.xml"],
        &["render", &cornell, "--time-limit", "soon"],
        &["render", &cornell, "--spp", "0"],
        &["render", &cornell, "--passes", "4", "--spp", "4"],
        &["render", &cornell, "--crop", "1,2,3"],
        &["render", &cornell, "-D", "spp"],
        &["render", &cornell, "--integrator", "magic"],
        &["render", &cornell, "--exposure", "nan"],
    ] {
        assert_eq!(dualux(args).status.code(), Some(2), "{args:?}");
    }
    let (_dir, out) = scratch("x.exr");
    let out = out.to_str().unwrap();
    for args in [
        &["render", "no-such-file.xml", "-o", out][..],
        &["render", &cornell, "-o", "x.tiff"],
        &["render", &cornell, "-o", out, "--crop", "500,0,100,100"],
        &["render", &cornell, "-o", out, "-D", "nonsense=1"],
        &["render", &cornell, "-o", "/no/such/folder/x.exr", "--spp", "1", "--scale", "0.02"],
        &["render", &cornell, "-o", out, "--reference", &scene("textures/vase.png")],
    ] {
        let done = dualux(args);
        assert_eq!(done.status.code(), Some(1), "{args:?}: {}", stderr(&done));
        assert!(stderr(&done).contains("error"), "{args:?}: {}", stderr(&done));
    }
}

#[test]
fn mistakes_in_a_scene_are_located_and_explained() {
    let (_dir, path) = scratch("wrong.xml");
    let text = "<scene version=\"3.0.0\">\n  <sensor type=\"perspective\"/>\n  <shape type=\"sphere\">\n    \
                <bsdf type=\"diffuse\"><rgb name=\"relfectance\" value=\"1\"/></bsdf>\n  </shape>\n</scene>\n";
    std::fs::write(&path, text).expect("written");
    let file = path.to_str().unwrap();
    let warned = dualux(&["info", file]);
    assert!(warned.status.success(), "{}", stderr(&warned));
    let said = stdout(&warned) + &stderr(&warned);
    assert!(said.contains("wrong.xml:4:") && said.contains("reflectance"), "{said}");
    let strict = dualux(&["info", file, "--strict"]);
    assert_eq!(strict.status.code(), Some(1));
    assert!(stderr(&strict).contains("wrong.xml:4:"), "{}", stderr(&strict));
}

#[test]
fn info_as_json_counts_what_is_there() {
    let out = dualux(&["info", &scene("cornell-spheres.xml"), "--json"]);
    let info: serde_json::Value = serde_json::from_slice(&out.stdout).expect("JSON");
    assert_eq!(info["shapes"]["sphere"], 3);
    assert_eq!(info["shapes"]["rectangle"], 7);
    // A square lamp of 0.6 x 0.6 with radiance 12: pi L A.
    let power = info["lights"][0]["power"][0].as_f64().expect("number");
    assert!((power - std::f64::consts::PI * 12.0 * 0.36).abs() < 1e-3, "{power}");
}

#[test]
fn a_time_limit_bounds_the_process() {
    let (_dir, out) = scratch("limited.exr");
    let limit = Duration::from_secs(1);
    let start = Instant::now();
    let done = dualux(&["render", &scene("cornell-box.xml"), "-o", out.to_str().unwrap(), "--time-limit", "1s"]);
    let elapsed = start.elapsed();
    assert!(done.status.success(), "{}", stderr(&done));
    // 0.2 s are promised on a quiet machine; tests run beside each other.
    assert!(elapsed < limit + Duration::from_secs(1), "{elapsed:?}");
    assert!(elapsed > limit / 2, "the time is used: {elapsed:?}");
    assert!(out.exists());
}

#[cfg(unix)]
#[test]
fn a_signal_writes_the_picture_so_far() {
    let (_dir, out) = scratch("stopped.exr");
    let mut child = Command::new(env!("CARGO_BIN_EXE_dualux"))
        .args(["render", &scene("cornell-box.xml"), "-o", out.to_str().unwrap(), "--spp", "1M", "-q"])
        .spawn()
        .expect("starts");
    std::thread::sleep(Duration::from_millis(1500));
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-TERM", &pid]).status().expect("kill").success());
    assert!(child.wait().expect("ends").success());
    let picture = dualux::image::read_image(&out).expect("readable");
    assert!(picture.pixels.iter().any(|p| p.x > 0.0));
}

#[test]
fn statistics_and_error_curve() {
    let (dir, exr) = scratch("r.exr");
    let (exr, json) = (exr.to_str().unwrap(), dir.path().join("s.json"));
    let cornell = scene("cornell-box.xml");
    let args = ["render", &cornell, "--integrator", "path", "-o", exr, "--scale", "0.1", "--spp", "4", "-q"];
    assert!(dualux(&args).status.success());
    let more = ["--seed", "9", "--reference", exr, "--stats-json", json.to_str().unwrap()];
    let out = dualux(&[&args[..], &more[..]].concat());
    assert!(out.status.success(), "{}", stderr(&out));
    let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).expect("written")).expect("JSON");
    assert_eq!(stats["passes"], 4);
    assert_eq!(stats["counts"]["samples"], 51 * 51 * 4);
    let curve = stats["error_curve"].as_array().expect("curve");
    let passes: Vec<_> = curve.iter().map(|p| p["passes"].as_u64().expect("number")).collect();
    assert_eq!(passes, [1, 2, 4], "each once");
    assert!(curve.iter().all(|p| p["relmse"].as_f64().expect("number") > 0.0));
}

#[test]
fn replay_takes_the_same_sample_again() {
    let cornell = scene("cornell-box.xml");
    let args = ["render", &cornell, "--scale", "0.1", "--replay", "20,30,7"];
    let (a, b) = (stdout(&dualux(&args)), stdout(&dualux(&args)));
    assert!(a.contains("pixel 20,30 sample 7 of pass 7") && a == b, "{a}{b}");
}

#[test]
fn completions_are_printed() {
    assert!(stdout(&dualux(&["completions", "bash"])).contains("--time-limit"));
}

#[test]
fn names_that_cannot_be_written_cost_no_render() {
    let cornell = scene("cornell-box.xml");
    let (dir, out) = scratch("x.exr");
    let out = out.to_str().unwrap();
    let folder = dir.path().to_str().unwrap();
    let missing = format!("{folder}/missing/x.exr");
    let start = Instant::now();
    for more in [&["-o", &missing][..], &["-o", out, "--stats-json", folder], &["-o", out, "--stats-json", &missing]] {
        let done = dualux(&[&["render", &cornell, "--spp", "1M"], more].concat());
        assert_eq!(done.status.code(), Some(1), "{more:?}: {}", stderr(&done));
    }
    // A million samples per pixel take hours.
    assert!(start.elapsed() < Duration::from_secs(60));
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "nothing stays behind");
}

#[test]
fn layers_asked_for_twice_are_written_once_and_the_seed_of_the_file_is_noted() {
    let (dir, path) = scratch("seeded.xml");
    let text = "<scene version=\"3.0.0\"><sensor type=\"perspective\"><sampler type=\"independent\"><integer name=\"seed\" \
                value=\"42\"/></sampler><film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer name=\"height\" \
                value=\"8\"/></film></sensor><emitter type=\"constant\"/></scene>";
    std::fs::write(&path, text).expect("written");
    let exr = dir.path().join("x.exr");
    let seed_of = |more: &[&str]| {
        let args = ["render", path.to_str().unwrap(), "-o", exr.to_str().unwrap(), "--aov", "depth,albedo,depth"];
        let out = dualux(&[&args[..], more].concat());
        assert!(out.status.success(), "{}", stderr(&out));
        let meta = exr::meta::MetaData::read_from_file(&exr, false).expect("EXR");
        let other = &meta.headers[0].own_attributes.other;
        let attribute = other.iter().find(|(name, _)| name.as_slice() == b"dualux:seed").expect("seed").1;
        format!("{attribute:?}")
    };
    assert!(seed_of(&[]).contains("42"), "{}", seed_of(&[]));
    assert!(seed_of(&["--seed", "7"]).contains('7'));
    assert_eq!(exr_channels(&exr).iter().filter(|n| n.starts_with("depth")).count(), 1);
}

#[test]
fn a_reference_must_show_the_whole_frame_or_just_the_window() {
    let (dir, full) = scratch("full.exr");
    let (full, cut, out) = (full.to_str().unwrap(), dir.path().join("cut.png"), dir.path().join("out.exr"));
    let (cut, out) = (cut.to_str().unwrap(), out.to_str().unwrap());
    let args = ["render", &scene("cornell-box.xml"), "--scale", "0.1", "--spp", "1", "-q", "-o"];
    let crop = ["--crop", "10,10,8,8"];
    assert!(dualux(&[&args[..], &[full]].concat()).status.success());
    assert!(dualux(&[&args[..], &[cut], &crop].concat()).status.success());
    for reference in [full, cut] {
        let done = dualux(&[&args[..], &[out, "--reference", reference], &crop].concat());
        assert!(done.status.success(), "{reference}: {}", stderr(&done));
    }
    // A larger picture is no reference for a smaller one: its corner shows something else.
    let small = ["render", &scene("cornell-box.xml"), "--scale", "0.05", "--spp", "1", "-o", out, "--reference", full];
    let done = dualux(&small);
    assert_eq!(done.status.code(), Some(1), "{}", stderr(&done));
    assert!(stderr(&done).contains("do not fit"), "{}", stderr(&done));
}

#[cfg(target_os = "linux")]
#[test]
fn closed_pipes_full_disks_and_odd_names_do_not_panic() {
    use std::os::unix::ffi::OsStrExt;
    use std::process::Stdio;
    let cornell = scene("cornell-box.xml");
    let (dir, out) = scratch("x.exr");
    let render = ["render", &cornell, "--scale", "0.02", "--spp", "1", "-o", out.to_str().unwrap()];
    let commands: [&[&str]; 4] =
        [&["info", &cornell], &["info", &cornell, "--json"], &["completions", "bash"], &render];
    let full = || Stdio::from(std::fs::File::options().write(true).open("/dev/full").expect("device"));
    for args in commands {
        let mut command = Command::new(env!("CARGO_BIN_EXE_dualux"));
        let status = command.args(args).stdout(full()).stderr(full()).status().expect("starts");
        assert_eq!(status.code(), Some(1), "{args:?}: a result that cannot be written is an error");
        // A reader that is gone before anything is written.
        let (reader, writer) = std::io::pipe().expect("pipe");
        drop(reader);
        let mut command = Command::new(env!("CARGO_BIN_EXE_dualux"));
        assert!(command.args(args).stdout(writer).status().expect("starts").success(), "{args:?}");
    }
    let odd = dir.path().join(std::ffi::OsStr::from_bytes(b"x\xe9 y.png"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_dualux"));
    let done = command.args(&render[..6]).arg("-o").arg(&odd).output().expect("starts");
    assert!(done.status.success() && odd.exists(), "{}", stderr(&done));
}

#[test]
fn any_timeout_in_a_file_is_survived() {
    let (dir, path) = scratch("timeout.xml");
    for seconds in ["1e20", "1e29", "1e9", "0.001"] {
        let text = format!(
            "<scene version=\"3.0.0\"><integrator type=\"path\"><float name=\"timeout\" value=\"{seconds}\"/></integrator>\
             <sensor type=\"perspective\"/><emitter type=\"constant\"/></scene>"
        );
        std::fs::write(&path, text).expect("written");
        let out = dir.path().join("x.png");
        let args = ["render", path.to_str().unwrap(), "-o", out.to_str().unwrap(), "--scale", "0.02", "--spp", "2"];
        assert!(dualux(&args).status.success(), "{seconds}");
    }
}
