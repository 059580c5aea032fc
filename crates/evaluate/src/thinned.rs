//! The states of a long drive, of which a figure of the whole drive needs only some.

use crate::scored_shift::DriveState;

/// Around a shift all states are kept, s: its figure shows them.
const AROUND_S: f64 = 1.0;

/// Leaves states out that say nothing of their own: those far from each shift, in the gear and with the health of the states before and
/// after them. Of these so many stay, at most, evenly over the drive. `shifts_s` are the times from which to which the shifts last, in their order.
/// What comes next may be another shift, so that the newest states are kept as well.
pub(crate) fn thinned(
    states: &[DriveState],
    shifts_s: impl Iterator<Item = [f64; 2]>,
    maximum: u32,
) -> Vec<DriveState> {
    let (Some(first), Some(last)) = (states.first(), states.last()) else { return Vec::new() };
    let (apart_s, newest_s) = ((last.time_s - first.time_s) / f64::from(maximum), last.time_s - AROUND_S);
    let says_nothing = |at: usize| {
        let same = |other: Option<&DriveState>| {
            other.is_some_and(|other| (other.gear, other.health) == (states[at].gear, states[at].health))
        };
        same(at.checked_sub(1).map(|before| &states[before])) && same(states.get(at + 1))
    };
    let mut shifts_s = shifts_s.peekable();
    let mut kept: Vec<DriveState> = Vec::new();
    for (at, state) in states.iter().enumerate() {
        while shifts_s.next_if(|[_, to_s]| to_s + AROUND_S < state.time_s).is_some() {}
        let is_of_shift = shifts_s.peek().is_some_and(|[from_s, _]| state.time_s >= from_s - AROUND_S);
        let is_near = kept.last().is_some_and(|kept| state.time_s - kept.time_s < apart_s);
        if is_of_shift || state.time_s >= newest_s || !is_near || !says_nothing(at) {
            kept.push(*state);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use car::Gear;

    use super::*;
    use observer::Health;

    #[test]
    fn a_drive_is_thinned_where_nothing_happens() {
        let state = |at: u32| DriveState {
            time_s: 0.01 * f64::from(at),
            gear: Gear::at(usize::from(at >= 5000)),
            pedals: [0.0; 2],
            vehicle_m_s: 10.0,
            speeds_rad_s: [100.0; 3],
            health: if at == 7777 { Health::Flare } else { Health::Good },
        };
        let states: Vec<DriveState> = (0..20_000).map(state).collect();
        let kept = thinned(&states, [[49.5, 50.0], [120.0, 121.0]].into_iter(), 1000);
        let is_kept = |at: u32| kept.contains(&state(at));
        // The first, all around both shifts, and the newest.
        let whole = [0..1, 4850..5100, 11_900..12_200, 19_900..20_000];
        assert!(whole.into_iter().flatten().all(is_kept));
        // The one of another health, with those before and after it.
        assert!((7776..7779).all(is_kept));
        assert!(kept.len() > 1000 && kept.len() < 1700, "{}", kept.len());
        // 200 s in a thousand intervals, and one step more.
        assert!(kept.windows(2).all(|pair| pair[1].time_s - pair[0].time_s < 0.211));
        // The same again leaves it as it is.
        assert_eq!(thinned(&kept, [[49.5, 50.0], [120.0, 121.0]].into_iter(), 1000), kept);
        assert_eq!(thinned(&[], std::iter::empty(), 1000), []);
    }
}
