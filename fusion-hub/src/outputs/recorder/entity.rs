//! Entity paths and styles: one colour per method, everywhere.

use cofix_common::recording::{EPOCH_WISE, FUSED, PHONES};
use rerun::external::re_log_types::EntityPathPart;
use rerun::{Color, EntityPath};

/// The origin of a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    /// Epoch-wise least squares of the agent.
    Wls,
    /// The agent's own filter.
    Local,
    /// The hub's filter over all phones.
    Joint,
    /// The reference.
    Truth,
}

impl Method {
    /// All methods, in the order of drawing, the least important first.
    pub const ALL: [Self; 4] = [Self::Wls, Self::Local, Self::Joint, Self::Truth];
    /// The methods whose errors are drawn.
    pub const SCORED: [Self; 3] = [Self::Wls, Self::Local, Self::Joint];

    /// The name in paths and legends.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Wls => EPOCH_WISE,
            Self::Local => "local",
            Self::Joint => FUSED,
            Self::Truth => "truth",
        }
    }

    /// Its colour: Okabe and Ito's palette, which colour-blind readers can tell apart, and grey.
    pub fn colour(self) -> Color {
        match self {
            Self::Wls => Color::from_rgb(0x99, 0x99, 0x99),
            Self::Local => Color::from_rgb(0xE6, 0x9F, 0x00),
            Self::Joint => Color::from_rgb(0x56, 0xB4, 0xE9),
            Self::Truth => Color::from_rgb(0x00, 0xC8, 0x8C),
        }
    }

    /// Width of its line in plots and maps, in points of the screen.
    pub const fn width(self) -> f32 {
        match self {
            Self::Wls => 1.0,
            Self::Local => 1.5,
            Self::Joint | Self::Truth => 2.0,
        }
    }
}

/// The colour of bounds in plots.
pub(super) fn bound_colour() -> Color {
    Color::from_rgb(0xD5, 0x5E, 0x00)
}

/// Colours of phones and pairs, in turn.
pub(super) fn palette(index: usize) -> Color {
    const COLOURS: [(u8, u8, u8); 6] = [
        (0x56, 0xB4, 0xE9),
        (0xF0, 0xE4, 0x42),
        (0xE0, 0x60, 0x9C),
        (0x00, 0xC8, 0x8C),
        (0xB5, 0x9C, 0xFF),
        (0xDD, 0xDD, 0xDD),
    ];
    let (red, green, blue) = COLOURS[index % COLOURS.len()];
    Color::from_rgb(red, green, blue)
}

/// The path of the parts, whatever characters they contain.
pub(super) fn path<'a>(parts: impl IntoIterator<Item = &'a str>) -> EntityPath {
    EntityPath::new(parts.into_iter().map(EntityPathPart::new).collect())
}

/// A path under a phone's.
pub(super) fn phone_path<'a>(phone: &'a str, parts: impl IntoIterator<Item = &'a str>) -> EntityPath {
    path([PHONES, phone].into_iter().chain(parts))
}

/// The name of a pair of phones in paths and legends.
pub(super) fn pair_name(first: &str, second: &str) -> String {
    format!("{first}–{second}")
}

/// The query expression of an entity and everything below it.
pub(super) fn subtree(entity: &EntityPath) -> String {
    format!("+ {entity}/**")
}
