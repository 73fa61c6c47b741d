//! Rules that bring files of Mitsuba 0.4 to 0.6 to today's spelling.
//!
//! Source      the upgrade of Mitsuba 3's own reader (property names), and what real files need beyond it
//! Not handled version 0.3 and older (`camera`, `luminaire`): refused with a text

/// `toWorld` -> `to_world`; runs of capitals fold: `intIOR` -> `int_ior`.
pub fn snake_case(name: &str) -> String {
    let mut out = String::with_capacity(name.len() + 4);
    let mut last_upper = true;
    for c in name.chars() {
        let upper = c.is_ascii_uppercase();
        if upper && !last_upper && !out.ends_with('_') {
            out.push('_');
        }
        out.push(c.to_ascii_lowercase());
        last_upper = upper;
    }
    out
}

/// A version number `major.minor.patch`; missing parts are 0.
pub fn version(text: &str) -> Result<[u32; 3], String> {
    let mut parts = [0; 3];
    let words: Vec<&str> = text.trim().split('.').collect();
    if words.len() > 3 {
        return Err(format!("expected a version such as 3.0.0, got \"{}\"", super::values::brief(text)));
    }
    for (part, word) in parts.iter_mut().zip(words) {
        *part = word
            .parse()
            .map_err(|_| format!("expected a version such as 3.0.0, got \"{}\"", super::values::brief(text)))?;
    }
    Ok(parts)
}

/// Plugins that were renamed: (tag, old, new).
const RENAMED: [(&str, &str, &str); 3] =
    [("bsdf", "bump", "bumpmap"), ("film", "exrfilm", "hdrfilm"), ("film", "pngfilm", "ldrfilm")];

/// Today's name of a plugin.
pub fn plugin(tag: &str, kind: &str) -> String {
    let renamed = RENAMED.iter().find(|(t, old, _)| *t == tag && *old == kind);
    renamed.map_or(kind, |(_, _, new)| new).to_owned()
}

/// Today's name of a property of an object, given in snake case.
pub fn property(tag: &str, kind: &str, name: String) -> String {
    match (tag, kind, name.as_str()) {
        ("bsdf", "diffuse" | "roughdiffuse", "diffuse_reflectance") => "reflectance".into(),
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names() {
        for (old, new) in [
            ("toWorld", "to_world"),
            ("intIOR", "int_ior"),
            ("maxDepth", "max_depth"),
            ("kNN", "k_nn"),
            ("to_world", "to_world"),
            ("Alpha", "alpha"),
            ("", ""),
        ] {
            assert_eq!(snake_case(old), new);
        }
    }

    #[test]
    fn versions() {
        assert_eq!(version("0.6.0"), Ok([0, 6, 0]));
        assert_eq!(version("3"), Ok([3, 0, 0]));
        for bad in ["", "x", "1.2.3.4", "-1.0", "99999999999"] {
            assert!(version(bad).is_err(), "{bad}");
        }
    }
}
