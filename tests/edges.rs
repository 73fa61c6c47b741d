//! The subcommand `edges` and the layer `edges` of a render, as a user meets them.

#[path = "common/cli.rs"]
mod cli;

use cli::{dualux, scene, scratch, stderr};
use std::path::Path;

/// Names and values of an EXR file's channels.
type Channels = Vec<(String, Vec<f32>)>;

/// Size and channels of an EXR file.
fn channels(path: &Path) -> ((usize, usize), Channels) {
    use exr::prelude::*;
    let image = read().no_deep_data().largest_resolution_level().all_channels().all_layers().all_attributes();
    let image = image.from_file(path).expect("an EXR file");
    let size = image.layer_data[0].size;
    let layers = image.layer_data.iter().flat_map(|l| &l.channel_data.list);
    let list = layers.map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect();
    ((size.0, size.1), list)
}

fn channel<'a>(list: &'a [(String, Vec<f32>)], name: &str) -> &'a [f32] {
    let names: Vec<_> = list.iter().map(|c| &c.0).collect();
    &list.iter().find(|c| c.0 == name).unwrap_or_else(|| panic!("{name} in {names:?}")).1
}

#[test]
fn a_map_is_written_as_picture_and_as_numbers() {
    let (dir, exr) = scratch("edges.exr");
    let png = dir.path().join("edges.png");
    let out = dualux(&[
        "edges",
        &scene("edges/thin-lens.xml"),
        "-o",
        exr.to_str().unwrap(),
        "-o",
        png.to_str().unwrap(),
        "-t",
        "1",
    ]);
    assert!(out.status.success(), "{}", stderr(&out));
    let (size, list) = channels(&exr);
    assert_eq!(size, (128, 128));
    let (event, kinds, distance) = (channel(&list, "event"), channel(&list, "kinds"), channel(&list, "distance"));
    assert!(event.iter().all(|e| *e == 0.0 || *e == 1.0));
    let events = event.iter().filter(|e| **e == 1.0).count();
    assert!((200..8000).contains(&events), "{events}");
    // Kinds are whole numbers, there where an event is, and have a distance.
    for ((e, k), d) in event.iter().zip(kinds).zip(distance) {
        assert_eq!(k.fract(), 0.0);
        assert_eq!(*e == 1.0, *k != 0.0);
        assert!(*e == 0.0 || *d >= 0.0, "{d}");
    }
    assert!(String::from_utf8_lossy(&out.stdout).contains(&format!("{events} of 16384 footprints")));
    let (width, height, pixels) = picture(&png);
    assert_eq!((width, height), (128, 128));
    let coloured = pixels.iter().filter(|p| **p != [0; 3]).count();
    assert!(coloured >= events, "{coloured} of {events}");
}

/// Width, height and pixels of a PNG file.
fn picture(path: &Path) -> (u32, u32, Vec<[u8; 3]>) {
    let image = image::open(path).expect("a PNG file").to_rgb8();
    (image.width(), image.height(), image.pixels().map(|p| p.0).collect())
}

#[test]
fn the_map_of_a_light_tells_penumbrae_from_the_lit_and_the_dark() {
    let (_dir, exr) = scratch("light.exr");
    let out = dualux(&["edges", &scene("edges/mirror-and-glass.xml"), "--light", "0", "-o", exr.to_str().unwrap()]);
    assert!(out.status.success(), "{}", stderr(&out));
    let (_, list) = channels(&exr);
    let event = channel(&list, "event");
    let share = event.iter().sum::<f32>() / event.len() as f32;
    assert!((0.01..0.6).contains(&share), "{share}");
    let wrong = dualux(&["edges", &scene("edges/thin-lens.xml"), "--light", "7"]);
    assert_eq!(wrong.status.code(), Some(1));
    assert!(stderr(&wrong).contains("1 area lights"), "{}", stderr(&wrong));
}

#[test]
fn the_emission_of_a_light_unrolls_to_its_hemicube() {
    let (_dir, exr) = scratch("emission.exr");
    let args =
        ["edges", &scene("cornell-spheres.xml"), "--emission", "0", "--cells", "32", "-o", exr.to_str().unwrap()];
    let out = dualux(&args);
    assert!(out.status.success(), "{}", stderr(&out));
    let (size, list) = channels(&exr);
    assert_eq!(size, (64, 64));
    let event = channel(&list, "event");
    // The corners of the picture belong to no face; the room's edges and balls show in the middle.
    assert!((0..16).all(|y| (0..16).all(|x| event[y * 64 + x] == 0.0)));
    assert!(event.iter().filter(|e| **e == 1.0).count() > 40);
}

#[test]
fn a_score_has_the_stated_keys_and_the_detector_passes_it() {
    let (_dir, json) = scratch("score.json");
    let args = ["edges", &scene("edges/tiny-spheres.xml"), "--score", "16", "--json", json.to_str().unwrap()];
    let out = dualux(&args);
    assert!(out.status.success(), "{}", stderr(&out));
    let text = std::fs::read_to_string(&json).expect("written");
    let list: Vec<serde_json::Value> = serde_json::from_str(&text).expect("a list of objects");
    assert_eq!(list.len(), 2, "{text}");
    for (one, test) in list.iter().zip(["bounds", "corners"]) {
        assert_eq!((one["family"].as_str(), one["test"].as_str()), (Some("pixel"), Some(test)));
        assert_eq!(one["order"], 2);
        // A few are left out, whose edge lies between the rays of two pixels.
        let footprints = one["footprints"].as_u64().unwrap();
        assert!((65_000..=256 * 256).contains(&footprints), "{footprints}");
        assert!(one["edges"].as_u64().unwrap() > 1000);
        for key in ["recall", "precision"] {
            assert!((0.0..=1.0).contains(&one[key].as_f64().unwrap()), "{key}");
        }
        assert!(one["cost_ratio"].as_f64().unwrap() > 0.0);
    }
    // `bounds` is exact here; the neighbours pass over some of what is smaller than their distance.
    let recall = [0, 1].map(|k: usize| list[k]["recall"].as_f64().unwrap());
    assert!(recall[0] == 1.0 && recall[1] < 1.0 && recall[1] > 0.9, "{text}");
}

#[test]
fn chains_are_scored_where_there_are_mirrors() {
    let (_dir, json) = scratch("score.json");
    let scene = scene("edges/mirror-and-glass.xml");
    let out = dualux(&["edges", &scene, "--score", "4", "--json", json.to_str().unwrap()]);
    assert!(out.status.success(), "{}", stderr(&out));
    let list: Vec<serde_json::Value> = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    let chain = list.iter().find(|s| s["family"] == "chain").expect("a line for chains");
    assert!(chain["edges"].as_u64().unwrap() > 500 && chain["recall"].as_f64().unwrap() >= 0.99, "{chain}");
}

#[test]
fn edges_are_a_layer_of_a_render() {
    let (_dir, exr) = scratch("render.exr");
    let args = ["render", &scene("penumbra.xml"), "--scale", "0.2", "--spp", "1", "--aov", "edges", "-o"];
    let out = dualux(&[&args[..], &[exr.to_str().unwrap()]].concat());
    assert!(out.status.success(), "{}", stderr(&out));
    let (size, list) = channels(&exr);
    assert_eq!(size, (64, 64));
    let event = list.iter().find(|c| c.0.starts_with("edges.") && c.0.ends_with("event"));
    let (_, event) = event.unwrap_or_else(|| panic!("{:?}", list.iter().map(|c| &c.0).collect::<Vec<_>>()));
    assert!(event.contains(&1.0) && event.contains(&0.0));
}
