//! Kinds of events, and what a query answers.

use super::chord::Chord;

/// A set of kinds of events, as bits.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Kinds(pub u16);

impl Kinds {
    /// Nothing.
    pub const NONE: Kinds = Kinds(0);
    /// The end of an open surface: border of a rectangle, rim, edge with one face.
    pub const BOUNDARY: Kinds = Kinds(1);
    /// Two faces meet at [`crate::scene::mesh::CREASE_ANGLE`] or more.
    pub const CREASE: Kinds = Kinds(2);
    /// A surface turns away.
    pub const SILHOUETTE: Kinds = Kinds(4);
    /// Two surfaces exchange their depth order.
    pub const SWAP: Kinds = Kinds(8);
    /// The receiver's horizon.
    pub const HORIZON: Kinds = Kinds(16);
    /// The emitter's dark side begins.
    pub const EMITTER: Kinds = Kinds(32);
    /// The border of a highlight.
    pub const HIGHLIGHT: Kinds = Kinds(64);
    /// Total internal reflection begins.
    pub const TOTAL_REFLECTION: Kinds = Kinds(128);
    /// Seen by reflection in a smooth surface.
    pub const MIRRORED: Kinds = Kinds(256);
    /// Seen through a smooth boundary.
    pub const REFRACTED: Kinds = Kinds(512);
    /// Too many edges or surfaces to look at one by one.
    pub const BUSY: Kinds = Kinds(1024);
    /// A surface without a margin: a mask, a surface that rays pass.
    pub const UNKNOWN: Kinds = Kinds(2048);

    /// Names, in the order of the bits.
    pub const NAMES: [&'static str; 12] = [
        "boundary",
        "crease",
        "silhouette",
        "swap",
        "horizon",
        "emitter",
        "highlight",
        "total reflection",
        "mirrored",
        "refracted",
        "busy",
        "unknown",
    ];

    /// Whether any kind is in both sets.
    pub fn intersects(self, other: Kinds) -> bool {
        self.0 & other.0 != 0
    }
}

impl std::ops::BitOr for Kinds {
    type Output = Kinds;
    fn bitor(self, other: Kinds) -> Kinds {
        Kinds(self.0 | other.0)
    }
}

impl std::ops::BitOrAssign for Kinds {
    fn bitor_assign(&mut self, other: Kinds) {
        self.0 |= other.0;
    }
}

impl std::fmt::Debug for Kinds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut first = true;
        for (bit, name) in Kinds::NAMES.iter().enumerate() {
            if self.0 >> bit & 1 == 1 {
                write!(f, "{}{name}", if first { "" } else { "|" })?;
                first = false;
            }
        }
        if first { write!(f, "none") } else { Ok(()) }
    }
}

/// What is known of the events in a footprint. An `any` query stops at the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Events {
    /// Kinds found.
    pub kinds: Kinds,
    /// Distance of the nearest from the centre, in half widths of the footprint, to first order.
    pub distance: f64,
    /// The nearest straight one (curves: a piece of it).
    pub chord: Option<Chord>,
}

/// Answer of a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// One surface without a visible edge, or nothing, in all of the footprint.
    Clear,
    /// Something changes.
    Events(Events),
    /// No margin tells: sample. What was found before is in the events.
    Unknown(Events),
}

impl Verdict {
    /// The kinds found; none for `Clear`.
    pub fn kinds(&self) -> Kinds {
        match self {
            Verdict::Clear => Kinds::NONE,
            Verdict::Events(e) | Verdict::Unknown(e) => e.kinds,
        }
    }

    /// Distance of the nearest event, infinite if there is none.
    pub fn distance(&self) -> f64 {
        match self {
            Verdict::Clear => f64::INFINITY,
            Verdict::Events(e) | Verdict::Unknown(e) => e.distance,
        }
    }

    /// What was found.
    pub fn events(&self) -> Option<&Events> {
        match self {
            Verdict::Clear => None,
            Verdict::Events(e) | Verdict::Unknown(e) => Some(e),
        }
    }

    /// True unless the footprint is known to be without event.
    pub fn needs_samples(&self) -> bool {
        *self != Verdict::Clear
    }
}

/// What a light's footprint sees of the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightVerdict {
    /// All of it.
    Visible,
    /// Nothing: it is behind surfaces that leave no gap, behind the horizon, or turns its dark side.
    Blocked,
    /// Some of it.
    Partial(Events),
    /// No margin tells: sample.
    Unknown(Events),
}

impl LightVerdict {
    /// The kinds found; none if all or nothing is seen.
    pub fn kinds(&self) -> Kinds {
        match self {
            LightVerdict::Visible | LightVerdict::Blocked => Kinds::NONE,
            LightVerdict::Partial(e) | LightVerdict::Unknown(e) => e.kinds,
        }
    }
}
