//! Two plants of a cylinder with a stroke, by small explicit steps.

use drivetrain::Passage;

use super::Random;
use super::cars::{Car, LINE_PA};
use super::shifts::{Log, STEP_S, Start};

/// A cylinder behind its valve.
pub(crate) trait Cylinder {
    /// With the outlet pressure settled at `outlet_pa`: empty or full.
    fn at_rest(car: &Car, outlet_pa: f64, full: bool) -> Self;

    /// In any state.
    fn anywhere(random: &mut Random, car: &Car) -> Self;

    /// One small step towards the settled pressure; returns the cylinder pressure at its end.
    fn step(&mut self, random: &mut Random, car: &Car, settled_pa: f64) -> f64;
}

/// Cylinder pressure at the end of each small step.
pub(crate) fn simulate<P: Cylinder>(random: &mut Random, car: &Car, log: &Log) -> Vec<f64> {
    let settled = |command_a: f64| car.gain_factor * car.valve.settled_pressure(command_a);
    let (before, full) = match log.start {
        Start::AtRest { command_a } => (command_a, command_a > 0.1),
        Start::Unknown => (log.sent_a[0], false),
    };
    let half = car.hysteresis_pa;
    let mut asked = settled(before) + random.within([-half, half]);
    let mut plant = match log.start {
        Start::AtRest { .. } => P::at_rest(car, asked.clamp(0.0, LINE_PA), full),
        Start::Unknown => P::anywhere(random, car),
    };
    (0..log.sent_a.len())
        .map(|step| {
            let arrived = step.checked_sub(car.delay_steps).map_or(before, |at| log.sent_a[at]);
            let target = settled(arrived);
            // The play operator.
            asked = asked.clamp(target - half, target + half);
            plant.step(random, car, asked.clamp(0.0, LINE_PA))
        })
        .collect()
}

fn flow(car: &Car, drop_pa: f64) -> f64 {
    if drop_pa >= 0.0 { car.apply.flow(drop_pa, car.oil_m2_s) } else { -car.exhaust.flow(-drop_pa, car.oil_m2_s) }
}

/// States: outlet pressure and volume; everything constant.
pub(crate) struct Exact {
    outlet_pa: f64,
    volume_m3: f64,
}

impl Exact {
    fn pressure(&self, car: &Car) -> f64 {
        let (v, full) = (self.volume_m3, car.volume_m3);
        let p = if v < 0.0 {
            car.preload_pa + v / car.capacity
        } else if v < full {
            car.preload_pa + (car.kiss_pa - car.preload_pa) * v / full
        } else {
            car.kiss_pa + (v - full) / car.capacity
        };
        p.max(0.0)
    }
}

impl Cylinder for Exact {
    fn at_rest(car: &Car, outlet_pa: f64, full: bool) -> Self {
        let volume_m3 = if full {
            car.volume_m3 + (outlet_pa - car.kiss_pa) * car.capacity
        } else {
            (outlet_pa - car.preload_pa) * car.capacity
        };
        Self { outlet_pa, volume_m3 }
    }

    fn anywhere(random: &mut Random, car: &Car) -> Self {
        let outlet_pa = random.within([0.0, 0.8e6]);
        let top = random.within([0.0, 0.8e6]) * car.capacity;
        Self { outlet_pa, volume_m3: random.within([-car.preload_pa * car.capacity, car.volume_m3 + top]) }
    }

    fn step(&mut self, _: &mut Random, car: &Car, settled_pa: f64) -> f64 {
        let p = self.pressure(car);
        let lag_s = car.lag_factor * car.valve.time_constant_s.at(self.outlet_pa);
        let net = flow(car, self.outlet_pa - p) - car.leak * p;
        self.volume_m3 = (self.volume_m3 + STEP_S * net).max(-car.preload_pa * car.capacity);
        self.outlet_pa = settled_pa + (self.outlet_pa - settled_pa) * (-STEP_S / lag_s).exp();
        self.pressure(car)
    }
}

/// Where the piston is.
#[derive(Clone, Copy, PartialEq)]
enum Piston {
    Home,
    Strokes(f64),
    Kissed,
}

/// States: outlet pressure, stroke while the piston moves, pressure while it does not; a spring that is not linear; lag, passages, leak
/// and capacity wander anywhere in their intervals.
pub(crate) struct Wandering {
    outlet_pa: f64,
    pressure_pa: f64,
    piston: Piston,
    /// Places in the intervals, 0 to 1.
    lag: f64,
    passage: f64,
    leak: f64,
    capacity: f64,
}

impl Wandering {
    fn new(outlet_pa: f64, pressure_pa: f64, piston: Piston) -> Self {
        Self { outlet_pa, pressure_pa, piston, lag: 0.5, passage: 0.5, leak: 0.5, capacity: 0.5 }
    }

    fn between([low, high]: [f64; 2], fraction: f64) -> f64 {
        low + fraction * (high - low)
    }

    fn plateau(car: &Car, stroke: f64) -> f64 {
        car.preload_pa + (car.kiss_pa - car.preload_pa) * stroke * stroke
    }
}

impl Cylinder for Wandering {
    fn at_rest(car: &Car, outlet_pa: f64, full: bool) -> Self {
        if full {
            Self::new(outlet_pa, outlet_pa.max(car.kiss_pa), Piston::Kissed)
        } else {
            Self::new(outlet_pa, outlet_pa.min(car.preload_pa), Piston::Home)
        }
    }

    fn anywhere(random: &mut Random, car: &Car) -> Self {
        let outlet_pa = random.within([0.0, 0.8e6]);
        match random.count(0, 2) {
            0 => Self::new(outlet_pa, random.within([0.0, car.preload_pa]), Piston::Home),
            1 => {
                let stroke = random.fraction();
                Self::new(outlet_pa, Self::plateau(car, stroke), Piston::Strokes(stroke))
            }
            _ => Self::new(outlet_pa, random.within([car.kiss_pa, 0.8e6]), Piston::Kissed),
        }
    }

    fn step(&mut self, random: &mut Random, car: &Car, settled_pa: f64) -> f64 {
        for place in [&mut self.lag, &mut self.passage, &mut self.leak, &mut self.capacity] {
            *place = (*place + random.within([-0.06, 0.06])).clamp(0.0, 1.0);
        }
        let limits = &car.limits;
        let passage = |[low, high]: &[Passage<f64>; 2], drop: f64| {
            // Between the flows of both limits.
            Self::between([high.flow(drop, car.oil_m2_s), low.flow(drop, car.oil_m2_s)], self.passage)
        };
        let (s, p) = (self.outlet_pa, self.pressure_pa);
        let inflow = if s >= p { passage(&limits.supply, s - p) } else { -passage(&limits.exhaust, p - s) };
        let net = inflow - self.leak * limits.leak_m3_s_pa * p;
        let capacity = Self::between([0.6 * limits.capacity_m3_pa, limits.capacity_m3_pa], self.capacity);
        match self.piston {
            Piston::Home => {
                self.pressure_pa = (p + STEP_S * net / capacity).max(0.0);
                if self.pressure_pa >= car.preload_pa {
                    (self.pressure_pa, self.piston) = (car.preload_pa, Piston::Strokes(0.0));
                }
            }
            Piston::Strokes(stroke) => {
                let stroke = stroke + STEP_S * net / car.volume_m3;
                self.pressure_pa = Self::plateau(car, stroke.clamp(0.0, 1.0));
                self.piston = if stroke >= 1.0 {
                    Piston::Kissed
                } else if stroke < 0.0 {
                    Piston::Home
                } else {
                    Piston::Strokes(stroke)
                };
            }
            Piston::Kissed => {
                self.pressure_pa = p + STEP_S * net / capacity;
                if self.pressure_pa < car.kiss_pa {
                    (self.pressure_pa, self.piston) = (car.kiss_pa, Piston::Strokes(1.0));
                }
            }
        }
        let lag_s = Self::between(car.lag_limits, self.lag) * car.valve.time_constant_s.at(s);
        self.outlet_pa = settled_pa + (s - settled_pa) * (-STEP_S / lag_s).exp();
        self.pressure_pa
    }
}
