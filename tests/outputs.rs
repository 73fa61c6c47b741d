//! What a render leaves beside its picture, and what it starts from: layers, caches, photons, files of older programs.

#[path = "common/cli.rs"]
mod cli;

use cli::{dualux, scene, scratch, stderr};

#[test]
fn a_saved_cache_serves_another_picture_and_wrong_files_are_refused() {
    let (dir, exr) = scratch("a.exr");
    let file = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    let (exr, cache, stats) = (exr.to_str().unwrap(), file("a.cache"), file("s.json"));
    let (cornell, spheres) = (scene("cornell-box.xml"), scene("cornell-spheres.xml"));
    let render = |scene: &str, more: &[&str]| {
        let args = ["render", scene, "-o", exr, "--scale", "0.15", "--passes", "1", "-q", "--stats-json", &stats];
        dualux(&[&args[..], more].concat())
    };
    let prepared = |name: &str| {
        let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&stats).unwrap()).unwrap();
        json["prepared"][name].as_u64().unwrap_or_else(|| panic!("{name} in {json}"))
    };
    let first = render(&cornell, &["--save-cache", &cache]);
    assert!(first.status.success(), "{}", stderr(&first));
    let (rays, records) = (prepared("cache rays of records"), prepared("cache records"));
    let second = render(&cornell, &["--load-cache", &cache]);
    assert!(second.status.success(), "{}", stderr(&second));
    assert_eq!(prepared("cache records loaded"), records);
    let new = prepared("cache records") - records;
    assert!(new * 5 < records && prepared("cache rays of records") * 5 < rays, "{new} new beside {records}");

    let whole = std::fs::read(&cache).unwrap();
    std::fs::write(file("cut.cache"), &whole[..whole.len() / 2]).unwrap();
    std::fs::write(file("text.cache"), "no cache").unwrap();
    for (scene, more, said) in [
        (&spheres, ["--load-cache", &cache], "other geometry"),
        (&cornell, ["--load-cache", &file("cut.cache")], "damaged"),
        (&cornell, ["--load-cache", &file("text.cache")], "no irradiance cache"),
        (&cornell, ["--load-cache", &file("missing.cache")], "missing.cache"),
        (&cornell, ["--load-cache", dir.path().to_str().unwrap()], "error"),
        (&cornell, ["--save-cache", &file("missing/x.cache")], "missing"),
    ] {
        let out = render(scene, &more);
        assert_eq!(out.status.code(), Some(1), "{more:?}: {}", stderr(&out));
        assert!(stderr(&out).contains(said) && !stderr(&out).contains("panicked"), "{more:?}: {}", stderr(&out));
    }
    for flag in ["--load-cache", "--save-cache"] {
        let out = render(&cornell, &["--integrator", "path", flag, &cache]);
        assert!(out.status.code() == Some(1) && stderr(&out).contains("uses no irradiance cache"), "{}", stderr(&out));
    }
}

#[test]
fn old_photon_integrators_run_as_ours_with_their_counts() {
    let (dir, path) = scratch("old.xml");
    let (exr, stats) = (dir.path().join("o.exr"), dir.path().join("s.json"));
    let [path, exr, stats] = [&path, &exr, &stats].map(|p| p.to_str().unwrap());
    let write = |kind: &str, words: &str| {
        let text = format!(
            "<scene version=\"0.5.0\"><integrator type=\"{kind}\"><integer name=\"maxDepth\" value=\"6\"/>{words}</integrator>
            <sensor type=\"perspective\"><transform name=\"toWorld\"><lookat origin=\"0,1,4\" target=\"0,0.5,0\" up=\"0,1,0\"/></transform>
            <film type=\"hdrfilm\"><integer name=\"width\" value=\"16\"/><integer name=\"height\" value=\"16\"/></film>
            <sampler type=\"independent\"><integer name=\"sampleCount\" value=\"2\"/></sampler></sensor>
            <shape type=\"rectangle\"><transform name=\"toWorld\"><rotate x=\"1\" angle=\"-90\"/></transform><bsdf type=\"diffuse\"/></shape>
            <shape type=\"sphere\"><point name=\"center\" y=\"0.6\"/><float name=\"radius\" value=\"0.3\"/><bsdf type=\"dielectric\"/></shape>
            <emitter type=\"point\"><point name=\"position\" y=\"2\"/></emitter></scene>"
        );
        std::fs::write(path, text).expect("written");
    };
    let run = || {
        let out = dualux(&["render", path, "-o", exr, "--emission", "uniform", "--stats-json", stats]);
        assert!(out.status.success(), "{}", stderr(&out));
        let json: serde_json::Value = serde_json::from_slice(&std::fs::read(stats).unwrap()).unwrap();
        (json, stderr(&out))
    };
    let info = || {
        let out = dualux(&["info", path, "--json"]);
        serde_json::from_slice::<serde_json::Value>(&out.stdout).expect("JSON")
    };
    let words = "<integer name=\"photonCount\" value=\"5000\"/><integer name=\"maxPasses\" value=\"3\"/><float name=\"initialRadius\" value=\"0.1\"/>";
    write("sppm", words);
    let (json, said) = run();
    assert_eq!((&json["integrator"], &json["passes"]), (&"photon".into(), &3.into()));
    assert_eq!(json["counts"]["photons"], 3 * 5000);
    assert!(said.contains("\"sppm\"") && said.contains("initialRadius is not used"), "{said}");
    assert_eq!(info()["integrator"], "photon");
    let warnings = info()["warnings"].to_string();
    assert!(warnings.contains("initialRadius"), "{warnings}");

    write(
        "photonmapper",
        "<integer name=\"globalPhotons\" value=\"9000\"/><integer name=\"causticPhotons\" value=\"700\"/>",
    );
    let (json, _) = run();
    assert_eq!((&json["passes"], &json["counts"]["photons"]), (&2.into(), &(2 * 700).into()));
    // What is asked for on the command line goes before.
    let out = dualux(&[
        "render",
        path,
        "-o",
        exr,
        "--caustic-photons",
        "300",
        "--passes",
        "1",
        "--emission",
        "uniform",
        "--stats-json",
        stats,
    ]);
    assert!(out.status.success(), "{}", stderr(&out));
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(stats).unwrap()).unwrap();
    assert_eq!(json["counts"]["photons"], 300);

    write("many-light", "");
    assert_eq!((&run().0["integrator"], &info()["integrator"]), (&"many-light".into(), &"many-light".into()));
    write("spppm", "");
    let warnings = info()["warnings"].to_string();
    assert!(warnings.contains("unknown integrator type") && warnings.contains("did you mean"), "{warnings}");
}

/// Values of an EXR file's channels by name, and the number of pixels.
fn exr_values(path: &str) -> (std::collections::BTreeMap<String, Vec<f32>>, usize) {
    use exr::prelude::{ReadChannels, ReadLayers, read};
    let image = read().no_deep_data().largest_resolution_level().all_channels().all_layers().all_attributes();
    let image = image.from_file(path).expect("EXR");
    let layer = &image.layer_data[0];
    let values = layer.channel_data.list.iter().map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect()));
    (values.collect(), layer.size.area())
}

#[test]
fn layers_say_what_the_picture_is_made_of_and_do_not_change_it() {
    let (dir, exr) = scratch("layers.exr");
    let (exr, plain) = (exr.to_str().unwrap(), dir.path().join("plain.exr"));
    let plain = plain.to_str().unwrap();
    let spheres = scene("cornell-spheres.xml");
    let stats = dir.path().join("s.json");
    let render = |out: &str, more: &[&str]| {
        let args = ["render", &spheres, "-o", out, "--scale", "0.1", "--passes", "3", "-q"];
        dualux(&[&args[..], &["--stats-json", stats.to_str().unwrap()], more].concat())
    };
    assert!(render(plain, &[]).status.success());
    let out = render(exr, &["--aov", "raw,samples,shadow-rays,direct,caustic,indirect,gathers,cache"]);
    assert!(out.status.success(), "{}", stderr(&out));
    let ((v, n), (before, _)) = (exr_values(exr), exr_values(plain));
    for c in ["R", "G", "B"] {
        assert_eq!(v[c], before[c], "the picture stays");
        let sum = |i: usize| ["direct", "caustic", "indirect"].map(|l| v[&format!("{l}.{c}")][i]).iter().sum::<f32>();
        let raw = &v[&format!("raw.{c}")];
        assert!((0..n).all(|i| (sum(i) - raw[i]).abs() <= 1e-4 * (1.0 + raw[i])), "the parts are the picture");
        // The filter has done something, and takes no light.
        let [all, all_raw] = [&v[c], raw].map(|p| p.iter().map(|x| f64::from(*x)).sum::<f64>());
        assert!(v[c] != *raw && (all / all_raw - 1.0).abs() < 5e-3, "{all} {all_raw}");
    }
    for name in ["direct.R", "caustic.R", "indirect.R", "shadow-rays.N", "cache.records", "cache.radius", "cache.error"]
    {
        assert!(v[name].iter().all(|x| x.is_finite() && *x >= 0.0) && v[name].iter().any(|x| *x > 0.0), "{name}");
    }
    assert!(v["cache.found"].iter().all(|x| (0.0..=1.0).contains(x)));
    // A record that is used beyond its radius has a greater error than the mean over it, but no more than at the border.
    assert!(v["cache.error"].iter().all(|e| *e <= 2.0 * 0.015 * 1.4 * 1.4));
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&stats).unwrap()).unwrap();
    let total = |name: &str| v[name].iter().map(|x| f64::from(*x)).sum::<f64>();
    assert_eq!(total("samples.N"), json["counts"]["samples"].as_f64().unwrap());
    assert_eq!(total("shadow-rays.N"), json["counts"]["direct"]["shadow_rays"].as_f64().unwrap());
    // A path goes on where no record was found; where a surface has two parts and there is no room for both, chance may choose the other.
    let share = total("gathers.N") / json["counts"]["cache_misses"].as_f64().unwrap();
    assert!(share > 0.5 && share <= 1.0, "{share}");
    let gathering = dir.path().join("gather.exr");
    let gathering = gathering.to_str().unwrap();
    assert!(render(gathering, &["--indirect", "gather", "--aov", "gathers,cache"]).status.success());
    let (g, _) = exr_values(gathering);
    let all: f32 = g["gathers.N"].iter().sum();
    assert!(f64::from(all) > total("gathers.N"), "{all}");
    assert!(g["cache.found"].iter().all(|x| *x == 0.0));
    let noisy = dir.path().join("noisy.exr");
    let noisy = noisy.to_str().unwrap();
    assert!(render(noisy, &["--denoise", "off", "--aov", "raw"]).status.success());
    let (noisy, _) = exr_values(noisy);
    assert_eq!(noisy["R"], noisy["raw.R"]);
    let out = render(exr, &["--integrator", "path", "--aov", "caustic"]);
    assert!(out.status.code() == Some(1) && stderr(&out).contains("--aov caustic"), "{}", stderr(&out));
}

#[test]
fn the_many_light_integrator_shows_its_roulette() {
    let (dir, exr) = scratch("many.exr");
    let file = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    let (cornell, exr, stats) = (scene("cornell-box.xml"), exr.to_str().unwrap(), file("s.json"));
    let render = |more: &[&str]| {
        let args = ["render", &cornell, "-o", exr, "--scale", "0.1", "--passes", "2", "-q", "--stats-json", &stats];
        dualux(&[&args[..], &["--integrator", "many-light"], more].concat())
    };
    let (points, cache) = (file("p.ply"), file("c.ply"));
    let layers = ["--aov", "roulette,watched,shadow-rays", "--watch-light", "17"];
    let out = render(&[&layers[..], &["--points", &points, "--cache-ply", &cache, "--cache-points", "40"]].concat());
    assert!(out.status.success(), "{}", stderr(&out));
    let (v, n) = exr_values(exr);
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&stats).unwrap()).unwrap();
    let count = |name: &str| json["counts"]["many_light"][name].as_f64().unwrap();
    let pairs = || v["roulette.pairs"].iter().map(|x| f64::from(*x));
    assert!((pairs().sum::<f64>() / count("pairs") - 1.0).abs() < 1e-6);
    for (layer, counter) in [("roulette.certain", "certain"), ("roulette.floored", "floored")] {
        let sum: f64 = pairs().zip(&v[layer]).map(|(p, share)| p * f64::from(*share)).sum();
        assert!((sum / count(counter) - 1.0).abs() < 1e-3, "{layer}: {sum} {}", count(counter));
    }
    for name in ["watched.pi", "watched.q", "watched.u", "watched.lit"] {
        assert!(v[name].iter().all(|x| (0.0..=1.0).contains(x)), "{name}");
        let lit = (0..n).filter(|&i| v["watched.lit"][i] > 0.0 && v[name][i] > 0.0).count();
        assert!(lit > n / 10, "{name}: {lit} of {n}");
    }
    for (path, vertex, least) in [(&points, 44, 500), (&cache, 32, 40)] {
        let (bytes, end, vertices) = ply(path);
        assert!(vertices >= least && bytes - end == vertices * vertex, "{path}: {vertices}");
    }
    for (flags, said) in [
        (&["--aov", "watched"][..], "--watch-light"),
        (&["--aov", "direct"], "--aov direct"),
        (&["--cache-ply", &cache, "--strategy", "exact"], "--cache-ply"),
        (&["--interleave", "0"], "--interleave"),
    ] {
        let out = render(flags);
        assert!(!out.status.success() && stderr(&out).contains(said), "{flags:?}: {}", stderr(&out));
    }
    let out = render(&["--watch-light", "9999999", "--aov", "watched"]);
    assert!(out.status.success() && stderr(&out).contains("9999999"), "{}", stderr(&out));
}

/// Size of a PLY file, where its header ends, and its number of vertices.
fn ply(path: &str) -> (usize, usize, usize) {
    let bytes = std::fs::read(path).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").expect("a header") + 11;
    let header = String::from_utf8_lossy(&bytes[..end]).into_owned();
    let n = header.lines().find_map(|l| l.strip_prefix("element vertex ")).expect("a number of vertices");
    (bytes.len(), end, n.parse().unwrap())
}

#[test]
fn photons_records_and_emission_are_shown_in_files() {
    let (dir, exr) = scratch("a.exr");
    let file = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    let ring = scene("caustic-ring.xml");
    let render = |scene: &str, more: &[&str]| {
        dualux(
            &[&["render", scene, "-o", exr.to_str().unwrap(), "--scale", "0.1", "--passes", "1", "-q"], more].concat(),
        )
    };
    let (photons, cache, density) = (file("p.ply"), file("c.ply"), file("d.exr"));
    let out = render(&ring, &["--photons-ply", &photons, "--cache-ply", &cache, "--emission-density", &density]);
    assert!(out.status.success(), "{}", stderr(&out));
    for (path, floats, more) in [(&photons, 18, 13), (&cache, 17, 0)] {
        let (bytes, end, n) = ply(path);
        assert!(n > 10 && bytes - end == n * (4 * floats + more), "{path}: {n}");
    }
    let (v, _) = exr_values(&density);
    assert!(v["density"].iter().any(|x| *x > 1.5), "photons gather somewhere");
    let out = render(&ring, &["--emission-density", &file("d.png")]);
    assert!(out.status.success() && std::fs::metadata(file("d.png")).unwrap().len() > 100, "{}", stderr(&out));
    let cornell = scene("cornell-box.xml");
    for (scene, flags, said) in [
        (&cornell, ["--photons-ply", &photons], "no photon"),
        (&cornell, ["--emission-density", &density], "no light"),
        (&ring, ["--emission-density", &file("d.txt")], ".exr or .png"),
        (&ring, ["--photons-ply", &file("missing/p.ply")], "missing"),
    ] {
        let out = render(scene, &flags);
        assert!(out.status.code() == Some(1) && stderr(&out).contains(said), "{flags:?}: {}", stderr(&out));
    }
}
