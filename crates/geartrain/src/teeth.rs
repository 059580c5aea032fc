//! Teeth that can mesh.

use drivetrain::Real;

use crate::description::{PlanetarySet, Planets};
use crate::finding::Fault;

/// Fewest teeth of a planet.
const FEWEST_TEETH: u32 = 8;
/// Teeth by which profile shift can make up for a wrong centre distance.
const PROFILE_SHIFT_TEETH: i64 = 2;
/// Height of the teeth above the pitch circle, in teeth of diameter.
const TIPS: f64 = 2.0;

/// What makes a set impossible, and what is unusual about it. The key comes first.
pub(crate) fn check<M>(set: &PlanetarySet<M>) -> Result<Vec<(&'static str, Fault)>, (&'static str, Fault)> {
    let (sun, ring) = (set.sun_teeth, set.ring_teeth);
    if ring <= sun {
        return Err(("ring_teeth", Fault::RingInSun { ring, sun }));
    }
    let mut unusual = Vec::new();
    let planets = if set.planets == Planets::Single { 1 } else { 2 };
    if !set.planet_teeth.is_empty() && set.planet_teeth.len() != planets {
        return Err(("planet_teeth", Fault::PlanetTeeth { found: set.planet_teeth.len(), wanted: planets }));
    }
    match (set.planets, set.planet_teeth.as_slice()) {
        (Planets::Single, &[planet]) => {
            let excess = i64::from(ring) - i64::from(sun) - 2 * i64::from(planet);
            let what = format!("sun {sun} + 2 x planet {planet} is {}, the ring has {ring}", i64::from(ring) - excess);
            match excess.abs() {
                0 => (),
                shift if shift <= PROFILE_SHIFT_TEETH => unusual.push(("planet_teeth", Fault::Coaxial(what))),
                _ => return Err(("planet_teeth", Fault::Coaxial(what))),
            }
        }
        (Planets::Single, _) => {
            let between = ring - sun;
            if between / 2 < FEWEST_TEETH {
                return Err(("sun_teeth", Fault::SmallPlanet { ring, sun, planet: between / 2 }));
            }
            if !between.is_multiple_of(2) {
                unusual.push(("ring_teeth", Fault::Odd(between)));
            }
        }
        (Planets::Double, &[inner, outer]) => {
            // The centres of sun, inner and outer planet are a triangle.
            let reach = u64::from(sun) + 2 * (u64::from(inner) + u64::from(outer));
            if reach < u64::from(ring) {
                let what =
                    format!("sun {sun} + 2 x planets {inner} and {outer} is {reach}, less than the ring's {ring}");
                return Err(("planet_teeth", Fault::Coaxial(what)));
            }
        }
        (Planets::Double, _) => (),
    }
    if let Some(count) = set.planet_count.filter(|&count| count > 0) {
        let sum = if set.planets == Planets::Single { ring.saturating_add(sun) } else { ring - sun };
        if !sum.is_multiple_of(count) {
            unusual.push(("planet_count", Fault::Assembly { count, sum }));
        }
        let planet = set.planet_teeth.first().copied().unwrap_or((ring - sun) / 2);
        let (pitch, planet_size) = (f64::from(sun) + f64::from(planet), f64::from(planet) + TIPS);
        if set.planets == Planets::Single
            && count > 1
            && pitch * Real::sin(std::f64::consts::PI / f64::from(count)) < planet_size
        {
            unusual.push(("planet_count", Fault::Crowded { count, planet }));
        }
    }
    Ok(unusual)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(
        planets: Planets,
        sun_teeth: u32,
        ring_teeth: u32,
        planet_count: Option<u32>,
        planet_teeth: &[u32],
    ) -> PlanetarySet<()> {
        PlanetarySet {
            sun: (),
            carrier: (),
            ring: (),
            sun_teeth,
            ring_teeth,
            planets,
            planet_count,
            planet_teeth: planet_teeth.to_vec(),
        }
    }

    #[test]
    fn a_set_that_meshes_is_neither_wrong_nor_unusual() {
        assert_eq!(check(&set(Planets::Single, 40, 80, Some(4), &[20])), Ok(vec![]));
        assert_eq!(check(&set(Planets::Double, 30, 72, Some(3), &[20, 18])), Ok(vec![]));
    }

    #[test]
    fn teeth_that_cannot_mesh_are_refused() {
        let fault = |set| check(&set).unwrap_err();
        assert_eq!(fault(set(Planets::Single, 60, 60, None, &[])).0, "ring_teeth");
        assert_eq!(
            fault(set(Planets::Single, 60, 70, None, &[])).1,
            Fault::SmallPlanet { ring: 70, sun: 60, planet: 5 }
        );
        assert!(matches!(fault(set(Planets::Single, 40, 80, None, &[17])).1, Fault::Coaxial(_)));
        assert!(matches!(fault(set(Planets::Double, 30, 72, None, &[10, 10])).1, Fault::Coaxial(_)));
        assert!(matches!(
            fault(set(Planets::Double, 30, 72, None, &[10])).1,
            Fault::PlanetTeeth { found: 1, wanted: 2 }
        ));
        assert_eq!(fault(set(Planets::Single, 0, 0, Some(0), &[])).0, "ring_teeth");
    }

    #[test]
    fn profile_shift_unequal_distances_and_crowded_planets_are_warned_of() {
        let faults = |set| check(&set).unwrap().into_iter().map(|(_, fault)| fault).collect::<Vec<_>>();
        assert_eq!(faults(set(Planets::Single, 37, 98, None, &[])), [Fault::Odd(61)]);
        assert_eq!(faults(set(Planets::Single, 37, 98, Some(4), &[30])).len(), 2);
        let crowded = [Fault::Assembly { count: 9, sum: 120 }, Fault::Crowded { count: 9, planet: 20 }];
        assert_eq!(faults(set(Planets::Single, 40, 80, Some(9), &[])), crowded);
        assert_eq!(faults(set(Planets::Double, 30, 72, Some(4), &[])), [Fault::Assembly { count: 4, sum: 42 }]);
    }

    #[test]
    fn the_largest_numbers_of_teeth_do_not_overflow() {
        for planets in [Planets::Single, Planets::Double] {
            let _ = check(&set(planets, u32::MAX - 1, u32::MAX, Some(u32::MAX), &[u32::MAX; 2]));
            let _ = check(&set(planets, 1, u32::MAX, Some(u32::MAX), &[u32::MAX]));
        }
    }
}
