//! A configuration: a name and flags of `render`.

use crate::cli::flags::Switch;
use crate::cli::load::SceneArgs;
use crate::cli::render::RenderArgs;
use clap::Parser;
use clap::error::ErrorKind;

/// What `compare SCENE` alone runs: name and flags.
pub const DEFAULT: &[(&str, &str)] =
    &[("uniform", "--integrator photon --emission uniform"), ("adaptive", "--integrator photon --emission adaptive")];

/// A named set of flags of `render`.
#[derive(Clone, Debug)]
pub struct Config {
    /// Name.
    pub name: String,
    /// Flags as they were written.
    pub flags: String,
    /// What they mean; the scene is a stand-in until [`Config::with_scene`].
    pub args: RenderArgs,
}

/// The flags of `render` without the program's name.
#[derive(Debug, Parser)]
#[command(name = "configuration", no_binary_name = true)]
struct Flags {
    #[command(flatten)]
    render: RenderArgs,
}

impl Config {
    /// Reads `name: flags`.
    pub fn parse(text: &str) -> Result<Config, String> {
        let (name, flags) = text.split_once(':').ok_or("expected \"name: flags of render\"")?;
        let (name, flags) = (name.trim(), flags.trim());
        if name.is_empty() {
            return Err("the name before the colon is missing".into());
        }
        Config::new(name, flags)
    }

    /// A configuration from flags as one would write them in a shell.
    pub fn new(name: &str, flags: &str) -> Result<Config, String> {
        let words = shlex::split(flags).ok_or("a quotation mark is not closed")?;
        let words = std::iter::once("SCENE".to_string()).chain(words);
        let mut args = Flags::try_parse_from(words).map_err(|e| reason(&e))?.render;
        for (given, flag) in [
            (!args.output.is_empty(), "--output"),
            (!args.reference.is_empty(), "--reference"),
            (!args.aov.is_empty(), "--aov"),
            (args.time_limit.is_some(), "--time-limit"),
            (args.save_every.is_some(), "--save-every"),
            (args.stats_json.is_some(), "--stats-json"),
            (args.replay.is_some(), "--replay"),
            (args.photon.save_cache.is_some(), "--save-cache"),
            (args.photon.photons_ply.is_some(), "--photons-ply"),
            (args.photon.cache_ply.is_some(), "--cache-ply"),
            (args.photon.emission_density.is_some(), "--emission-density"),
            (args.denoise.is_some(), "--denoise"),
            (args.exposure != 0.0, "--exposure"),
            (args.scene.threads.is_some(), "--threads"),
            (args.quiet, "--quiet"),
            (args.verbose, "--verbose"),
        ] {
            if given {
                return Err(format!("{flag} has no meaning for one configuration among several"));
            }
        }
        // Pictures are judged as they are, and samples are not taken for a filter.
        args.denoise = Some(Switch::Off);
        Ok(Config { name: name.into(), flags: flags.into(), args })
    }

    /// This configuration for a scene; its own definitions come after the common ones.
    pub fn with_scene(mut self, common: &SceneArgs) -> Config {
        let own = std::mem::replace(&mut self.args.scene, common.clone());
        self.args.scene.define.extend(own.define);
        self.args.scene.strict |= own.strict;
        if own.simd != crate::cli::load::SimdChoice::Auto {
            self.args.scene.simd = own.simd;
        }
        self
    }

    /// Most passes, if the flags say so.
    pub fn passes(&self) -> Option<u64> {
        self.args.passes.or(self.args.spp)
    }
}

/// What is wrong with the flags, without usage and advice for a command of its own.
fn reason(error: &clap::Error) -> String {
    if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
        return "expected flags that change how a picture is made; `dualux render --help` lists them".into();
    }
    let text = error.render().to_string();
    let text = text.strip_prefix("error: ").unwrap_or(&text);
    // The advice to pass a flag as a value does not help here; that of a similar flag does.
    let ends = ["\n\nUsage", "\n\nFor more", "\n\n  tip: to pass"];
    let end = ends.iter().filter_map(|e| text.find(e)).min().unwrap_or(text.len());
    text[..end].trim().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_those_of_render() {
        let c = Config::parse("deep : --integrator path --max-depth 7 -D 'key=a b' --spp 1K").unwrap();
        assert_eq!((c.name.as_str(), c.args.max_depth, c.passes()), ("deep", Some(7), Some(1000)));
        assert_eq!(c.args.denoise, Some(Switch::Off));
        assert_eq!(c.args.scene.define, [("key".to_string(), "a b".to_string())]);
        let mut common = c.args.scene.clone();
        (common.scene, common.define) = ("x.xml".into(), vec![("key".into(), "1".into())]);
        let joined = c.with_scene(&common);
        assert_eq!((joined.args.scene.scene.to_str(), joined.args.scene.define.len()), (Some("x.xml"), 2));
        assert_eq!(joined.args.scene.define[1].1, "a b");
        assert!(Config::parse("plain:").unwrap().flags.is_empty());
    }

    #[test]
    fn mistakes_are_named_and_nothing_panics() {
        let message = |text: &str| Config::parse(text).unwrap_err();
        assert!(message("--spp 4").contains("name: flags"));
        assert!(message(": --spp 4").contains("name"));
        assert!(message("a: --spp 'x").contains("quotation"));
        let unknown = message("a: --max-dept 4");
        assert!(unknown.contains("--max-dept") && unknown.contains("--max-depth"), "{unknown}");
        assert!(!unknown.contains("Usage") && !unknown.starts_with("error"), "{unknown}");
        assert!(!message("a: --foo").contains("tip"), "{}", message("a: --foo"));
        assert!(message("a: --spp 0").contains("at least 1"));
        assert!(message("a: --integrator magic").contains("magic"));
        assert!(message("a: other.xml").contains("other.xml"));
        assert!(message("a: --help").contains("render --help"));
        for flag in [
            "-o x.exr",
            "--time-limit 3s",
            "-t 2",
            "-q",
            "--reference a.exr",
            "--aov depth",
            "--save-cache c",
            "--denoise on",
        ] {
            assert!(message(&format!("a: {flag}")).contains("no meaning"), "{flag}");
        }
    }
}
