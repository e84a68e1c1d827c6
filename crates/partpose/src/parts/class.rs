//! The part classes of the paper at its three levels of detail.
//!
//! Names, ids and colours are those of Thomas Barowski's own annotations for Virtual KITTI
//! (`ThoBaro/partsegmentation_annotations`, MIT). Level C ("full") has 29 classes, level B ("fine") 9, level A
//! ("coarse") 4. Left and right are the vehicle's own. A is mapped from C, never from B: B counts side windows among
//! the doors, A among the glass.

use serde::{Deserialize, Serialize};

/// One of the 29 parts; background is not a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum PartClass {
    /// Lamp, front left.
    LightFrontLeft = 1,
    /// Lamp, front right.
    LightFrontRight = 2,
    /// Lamp, rear left.
    LightRearLeft = 3,
    /// Lamp, rear right.
    LightRearRight = 4,
    /// Wheel, front left.
    WheelFrontLeft = 5,
    /// Wheel, front right.
    WheelFrontRight = 6,
    /// Wheel, rear left.
    WheelRearLeft = 7,
    /// Wheel, rear right.
    WheelRearRight = 8,
    /// Bumper and skirt, front.
    ApronFront = 9,
    /// Bumper and skirt, rear.
    ApronRear = 10,
    /// Door, front left.
    DoorFrontLeft = 11,
    /// Door, front right.
    DoorFrontRight = 12,
    /// Door, rear left.
    DoorRearLeft = 13,
    /// Door, rear right.
    DoorRearRight = 14,
    /// Body side (fenders, sills, pillars), left.
    SideLeft = 15,
    /// Body side (fenders, sills, pillars), right.
    SideRight = 16,
    /// Windscreen, front.
    WindshieldFront = 17,
    /// Windscreen, rear.
    WindshieldRear = 18,
    /// Side window, front left.
    GlassFrontLeft = 19,
    /// Side window, front right.
    GlassFrontRight = 20,
    /// Side window, rear left.
    GlassRearLeft = 21,
    /// Side window, rear right.
    GlassRearRight = 22,
    /// Side window at the left C-pillar.
    GlassCornerLeft = 23,
    /// Side window at the right C-pillar.
    GlassCornerRight = 24,
    /// Roof.
    Roof = 25,
    /// Boot lid or tailgate.
    Trunk = 26,
    /// Bonnet.
    Hood = 27,
    /// Side mirror, left.
    MirrorLeft = 28,
    /// Side mirror, right.
    MirrorRight = 29,
}

/// Level B: 9 classes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum FineClass {
    /// Lights.
    Lights = 1,
    /// Wheels.
    Wheels = 2,
    /// Apron.
    Apron = 3,
    /// Doors.
    Doors = 4,
    /// Side.
    Side = 5,
    /// Windshield.
    Windshield = 6,
    /// Roof.
    Roof = 7,
    /// Trunk.
    Trunk = 8,
    /// Hood.
    Hood = 9,
}

/// Level A: 4 classes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum CoarseClass {
    /// Lights.
    Lights = 1,
    /// Wheels.
    Wheels = 2,
    /// Body.
    Body = 3,
    /// Glass.
    Glass = 4,
}

/// What a class is treated as by the filters of the pose stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartGroup {
    /// Lights and mirrors: small by nature, so exempt from the small-part filter (+WL).
    Whitelist,
    /// Sides, aprons and roof: their centres move with the viewpoint (+BL).
    Blacklist,
    /// Everything else.
    Neutral,
}

/// What is known of a class: name, colour, mirrored partner, level B.
struct Facts {
    name: &'static str,
    color: [u8; 3],
    opposite: PartClass,
    fine: FineClass,
}

const fn facts(name: &'static str, color: [u8; 3], opposite: PartClass, fine: FineClass) -> Facts {
    Facts { name, color, opposite, fine }
}

/// In the order of ids.
const FACTS: [Facts; PartClass::COUNT] = [
    facts("lights_FL", [255, 160, 122], PartClass::LightFrontRight, FineClass::Lights),
    facts("lights_FR", [255, 127, 0], PartClass::LightFrontLeft, FineClass::Lights),
    facts("lights_RL", [255, 236, 139], PartClass::LightRearRight, FineClass::Lights),
    facts("lights_RR", [255, 215, 0], PartClass::LightRearLeft, FineClass::Lights),
    facts("wheels_FL", [120, 120, 120], PartClass::WheelFrontRight, FineClass::Wheels),
    facts("wheels_FR", [10, 10, 10], PartClass::WheelFrontLeft, FineClass::Wheels),
    facts("wheels_RL", [248, 248, 255], PartClass::WheelRearRight, FineClass::Wheels),
    facts("wheels_RR", [205, 201, 201], PartClass::WheelRearLeft, FineClass::Wheels),
    facts("apron_F", [255, 0, 0], PartClass::ApronFront, FineClass::Apron),
    facts("apron_R", [208, 32, 144], PartClass::ApronRear, FineClass::Apron),
    facts("doors_FL", [255, 110, 180], PartClass::DoorFrontRight, FineClass::Doors),
    facts("doors_FR", [255, 20, 147], PartClass::DoorFrontLeft, FineClass::Doors),
    facts("doors_RL", [224, 102, 255], PartClass::DoorRearRight, FineClass::Doors),
    facts("doors_RR", [153, 50, 204], PartClass::DoorRearLeft, FineClass::Doors),
    facts("side_L", [210, 105, 0], PartClass::SideRight, FineClass::Side),
    facts("side_R", [139, 69, 19], PartClass::SideLeft, FineClass::Side),
    facts("windshield_F", [0, 0, 238], PartClass::WindshieldFront, FineClass::Windshield),
    facts("windshield_R", [139, 35, 35], PartClass::WindshieldRear, FineClass::Windshield),
    facts("glass_FL", [135, 206, 250], PartClass::GlassFrontRight, FineClass::Doors),
    facts("glass_FR", [28, 134, 238], PartClass::GlassFrontLeft, FineClass::Doors),
    facts("glass_RL", [39, 64, 139], PartClass::GlassRearRight, FineClass::Doors),
    facts("glass_RR", [0, 0, 139], PartClass::GlassRearLeft, FineClass::Doors),
    facts("glass_CL", [0, 205, 205], PartClass::GlassCornerRight, FineClass::Doors),
    facts("glass_CR", [0, 139, 139], PartClass::GlassCornerLeft, FineClass::Doors),
    facts("roof", [0, 139, 0], PartClass::Roof, FineClass::Roof),
    facts("trunk", [0, 238, 0], PartClass::Trunk, FineClass::Trunk),
    facts("hood", [0, 100, 0], PartClass::Hood, FineClass::Hood),
    facts("mirror_L", [200, 83, 86], PartClass::MirrorRight, FineClass::Side),
    facts("mirror_R", [157, 0, 4], PartClass::MirrorLeft, FineClass::Side),
];

impl PartClass {
    /// How many parts there are.
    pub const COUNT: usize = 29;

    /// All parts in the order of their ids.
    pub const ALL: [Self; Self::COUNT] = [
        Self::LightFrontLeft,
        Self::LightFrontRight,
        Self::LightRearLeft,
        Self::LightRearRight,
        Self::WheelFrontLeft,
        Self::WheelFrontRight,
        Self::WheelRearLeft,
        Self::WheelRearRight,
        Self::ApronFront,
        Self::ApronRear,
        Self::DoorFrontLeft,
        Self::DoorFrontRight,
        Self::DoorRearLeft,
        Self::DoorRearRight,
        Self::SideLeft,
        Self::SideRight,
        Self::WindshieldFront,
        Self::WindshieldRear,
        Self::GlassFrontLeft,
        Self::GlassFrontRight,
        Self::GlassRearLeft,
        Self::GlassRearRight,
        Self::GlassCornerLeft,
        Self::GlassCornerRight,
        Self::Roof,
        Self::Trunk,
        Self::Hood,
        Self::MirrorLeft,
        Self::MirrorRight,
    ];

    /// The part with an id from 1 to 29; `None` for background and beyond.
    pub fn from_id(id: u8) -> Option<Self> {
        Self::ALL.get(usize::from(id).checked_sub(1)?).copied()
    }

    /// The part with a name such as `wheels_FL`.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|class| class.name() == name)
    }

    /// The id, 1 to 29.
    pub const fn id(self) -> u8 {
        self as u8
    }

    /// Position in arrays over parts: the id less one.
    pub const fn index(self) -> usize {
        self as usize - 1
    }

    /// The name in the author's annotations.
    pub const fn name(self) -> &'static str {
        FACTS[self.index()].name
    }

    /// The RGB colour in the author's annotations; pairwise different.
    pub const fn color(self) -> [u8; 3] {
        FACTS[self.index()].color
    }

    /// The part that this one becomes when the image is flipped: left and right exchanged.
    #[must_use]
    pub const fn opposite(self) -> Self {
        FACTS[self.index()].opposite
    }

    /// Level B.
    pub const fn fine(self) -> FineClass {
        FACTS[self.index()].fine
    }

    /// Level A.
    pub const fn coarse(self) -> CoarseClass {
        match self.id() {
            1..=4 => CoarseClass::Lights,
            5..=8 => CoarseClass::Wheels,
            17..=24 => CoarseClass::Glass,
            _ => CoarseClass::Body,
        }
    }

    /// Whitelist, blacklist or neither (paper, § III-C).
    pub const fn group(self) -> PartGroup {
        match self.id() {
            1..=4 | 28 | 29 => PartGroup::Whitelist,
            9 | 10 | 15 | 16 | 25 => PartGroup::Blacklist,
            _ => PartGroup::Neutral,
        }
    }
}

impl FineClass {
    /// All classes in the order of their ids.
    pub const ALL: [Self; 9] = [
        Self::Lights,
        Self::Wheels,
        Self::Apron,
        Self::Doors,
        Self::Side,
        Self::Windshield,
        Self::Roof,
        Self::Trunk,
        Self::Hood,
    ];

    /// The id, 1 to 9.
    pub const fn id(self) -> u8 {
        self as u8
    }

    /// The name in the author's annotations.
    pub const fn name(self) -> &'static str {
        ["lights", "wheels", "apron", "doors", "side", "windshield", "roof", "trunk", "hood"]
            [self as usize - 1]
    }

    /// The RGB display colour; the side of level B differs from that of level C.
    pub const fn color(self) -> [u8; 3] {
        [
            [255, 160, 122],
            [10, 10, 10],
            [255, 10, 10],
            [255, 110, 180],
            [210, 105, 30],
            [139, 35, 35],
            [0, 139, 0],
            [0, 238, 0],
            [0, 100, 0],
        ][self as usize - 1]
    }
}

impl CoarseClass {
    /// All classes in the order of their ids.
    pub const ALL: [Self; 4] = [Self::Lights, Self::Wheels, Self::Body, Self::Glass];

    /// The id, 1 to 4.
    pub const fn id(self) -> u8 {
        self as u8
    }

    /// The name in the author's annotations.
    pub const fn name(self) -> &'static str {
        ["lights", "wheels", "body", "glass"][self as usize - 1]
    }

    /// The RGB display colour.
    pub const fn color(self) -> [u8; 3] {
        [[255, 160, 122], [10, 10, 10], [255, 10, 10], [0, 0, 238]][self as usize - 1]
    }
}

impl Serialize for PartClass {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for PartClass {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::from_name(&name)
            .ok_or_else(|| serde::de::Error::custom(format!("`{name}` is not a part")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn ids_names_and_colors_identify_a_part() {
        let colors: BTreeSet<_> = PartClass::ALL.iter().map(|class| class.color()).collect();
        assert_eq!(colors.len(), PartClass::COUNT);
        assert!(!colors.contains(&[0, 0, 0]));
        for (index, class) in PartClass::ALL.into_iter().enumerate() {
            assert_eq!(class.index(), index);
            assert_eq!(PartClass::from_id(class.id()), Some(class));
            assert_eq!(PartClass::from_name(class.name()), Some(class));
        }
        assert_eq!((PartClass::from_id(0), PartClass::from_id(30)), (None, None));
    }

    #[test]
    fn opposite_of_opposite_is_itself() {
        for class in PartClass::ALL {
            assert_eq!(class.opposite().opposite(), class);
            assert_eq!(class.opposite().fine(), class.fine());
            assert_eq!(class.opposite().coarse(), class.coarse());
            assert_eq!(class.opposite().group(), class.group());
        }
        let fixed = PartClass::ALL.iter().filter(|class| class.opposite() == **class);
        assert_eq!(fixed.map(|class| class.id()).collect::<Vec<_>>(), [9, 10, 17, 18, 25, 26, 27]);
    }

    #[test]
    fn side_windows_are_doors_when_fine_and_glass_when_coarse() {
        assert_eq!(PartClass::GlassCornerLeft.fine(), FineClass::Doors);
        assert_eq!(PartClass::GlassCornerLeft.coarse(), CoarseClass::Glass);
        assert_eq!(PartClass::MirrorRight.fine(), FineClass::Side);
        assert_eq!(PartClass::WindshieldRear.coarse(), CoarseClass::Glass);
    }
}
