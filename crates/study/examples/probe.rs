use ::study::comparison::{observers, run_observers};
use ::study::simulate_drive;
use config::{Experiment, Vehicle};
fn main() {
    let v = Vehicle::two_speed_at().unwrap();
    let e = Experiment::read(std::path::Path::new("experiments/bench.toml")).unwrap();
    for s in &e.scenarios {
        let x = e.with_scenario(s);
        let obs: Vec<_> = observers(&v, &x).unwrap();
        let t = simulate_drive(&v, &x).unwrap();
        let runs = run_observers(&v, &x, &obs, &t).unwrap();
        let r = runs.iter().find(|r| r.entry.name == "Kalman").unwrap();
        print!("{:20}", s.name);
        for q in &r.ranges {
            print!(
                " | {:.3} {:.3} {:.3}  w {:.3} {:5.0} {:5.0}",
                q.pressure_inside,
                q.torque_inside,
                q.shaft_inside,
                q.width_pa / 1e6,
                q.torque_width_n_m,
                q.shaft_width_n_m
            );
        }
        println!();
    }
}
