//! Gears and elements by their places in the gearbox.

/// Most elements of a gearbox: clutches, brakes, one-way clutches and dogs together.
pub const MAX_ELEMENTS: usize = 16;

/// An element by its place among all elements of its gearbox, one-way clutches and dogs included.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ElementId(u8);

/// A gear by its place among the gears of its gearbox.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GearId(u8);

/// A gear, or none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Gear {
    /// No gear drives the car.
    Neutral,
    /// A gear of the gearbox.
    In(GearId),
}

/// A change from one gear to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ShiftId {
    /// The gear before.
    pub from: GearId,
    /// The gear after.
    pub to: GearId,
}

impl ElementId {
    /// The element at this place; `None` from [`MAX_ELEMENTS`] on.
    #[inline]
    pub const fn new(place: usize) -> Option<Self> {
        // The place is below 16.
        if place < MAX_ELEMENTS { Some(Self(place as u8)) } else { None }
    }

    /// Its place among the elements of the gearbox.
    #[inline]
    pub const fn place(self) -> usize {
        self.0 as usize
    }
}

impl GearId {
    /// Most gears of a gearbox.
    pub const MAX_GEARS: usize = 64;

    /// The gear at this place; `None` from [`Self::MAX_GEARS`] on.
    #[inline]
    pub const fn new(place: usize) -> Option<Self> {
        // The place is below 64.
        if place < Self::MAX_GEARS { Some(Self(place as u8)) } else { None }
    }

    /// Its place among the gears of the gearbox.
    #[inline]
    pub const fn place(self) -> usize {
        self.0 as usize
    }
}

impl Gear {
    /// The gear at this place; neutral, of which no more is known, from [`GearId::MAX_GEARS`] on.
    #[inline]
    pub const fn at(place: usize) -> Self {
        match GearId::new(place) {
            Some(gear) => Self::In(gear),
            None => Self::Neutral,
        }
    }

    /// Its place among the gears of the gearbox; `None` in neutral.
    #[inline]
    pub const fn place(self) -> Option<usize> {
        match self {
            Self::Neutral => None,
            Self::In(gear) => Some(gear.place()),
        }
    }

    /// The gear; `None` in neutral.
    #[inline]
    pub const fn id(self) -> Option<GearId> {
        match self {
            Self::Neutral => None,
            Self::In(gear) => Some(gear),
        }
    }

    /// Whether no gear drives the car.
    #[inline]
    pub const fn is_neutral(self) -> bool {
        matches!(self, Self::Neutral)
    }
}

impl From<Option<GearId>> for Gear {
    /// Neutral where there is no gear.
    fn from(gear: Option<GearId>) -> Self {
        gear.map_or(Self::Neutral, Self::In)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_beyond_the_largest_gearbox_has_no_id() {
        assert_eq!(ElementId::new(MAX_ELEMENTS - 1).map(ElementId::place), Some(MAX_ELEMENTS - 1));
        assert_eq!(ElementId::new(MAX_ELEMENTS), None);
        assert_eq!(ElementId::new(usize::MAX), None);
        assert_eq!(GearId::new(GearId::MAX_GEARS - 1).map(GearId::place), Some(GearId::MAX_GEARS - 1));
        assert_eq!(GearId::new(GearId::MAX_GEARS), None);
    }

    #[test]
    fn neutral_is_no_gear() {
        let first = GearId::new(0);
        assert_eq!(Gear::from(first).id(), first);
        assert!(Gear::from(None).is_neutral() && Gear::Neutral.id().is_none());
    }
}
