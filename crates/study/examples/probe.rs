use config::{Vehicle,Experiment,ObserverKind}; use ::study::comparison::{observers,run_observers}; use ::study::{simulate_drive,AnyObserver}; use trace::signal;
use observer::Phase;
fn main() {
    let want: Vec<String> = std::env::args().skip(1).collect();
    let v = Vehicle::two_speed_at().unwrap();
    let e = Experiment::read(std::path::Path::new("experiments/bench.toml")).unwrap();
    let m = design::compliant::compliant_model(&v);
    for s in &e.scenarios {
        if !want.contains(&s.name) { continue }
        let mut x = e.with_scenario(s); if std::env::var("IDEAL").is_ok() { for o in &mut x.observers { o.real_sensors = false; } }
        let obs: Vec<AnyObserver> = observers(&v, &x).unwrap();
        let t = simulate_drive(&v, &x).unwrap();
        let runs = run_observers(&v, &x, &obs, &t).unwrap();
        let r = runs.iter().find(|r| r.entry.name == "Kalman").unwrap();
        let q = runs.iter().find(|r| r.entry.name == "inversion").unwrap();
        let col = |n: &str| t.get(n).unwrap();
        let at = |n: &str, ts: f64| { let c = col(n); let i = t.time_s.partition_point(|&y| y < ts - 1e-9).min(c.len()-1); c[i] };
        println!("{}", s.name);
        for i in 0..r.time_s.len() {
            let ts = r.time_s[i];
            let ph = r.estimates[i].phase;
            if !(ph == Phase::TorquePhase || ph == Phase::InertiaPhase) && i % 50 != 0 { continue }
            if i % 3 != 0 && i % 50 != 0 { continue }
            let tt = m.rigid.converter.torques(at(signal::ENGINE_SPEED, ts), at(signal::TURBINE_SPEED, ts)).turbine_n_m;
            println!("{:.2} {:13} p {:.3} k {:+.3} inv {:+.3} | Ts {:6.0} k {:+5.0} inv {:+5.0} | Tt {:5.1} map {:+5.1} | Tca {:5.1} | tw {:+.3}", ts, ph.name(), r.truth_pa[i]/1e6, (r.estimates[i].pressure_pa-r.truth_pa[i])/1e6, (q.estimates[i].pressure_pa-r.truth_pa[i])/1e6,
              at(signal::SHAFT_TORQUE, ts), r.estimates[i].shaft_torque_n_m.unwrap_or(0.0)-at(signal::SHAFT_TORQUE, ts), q.estimates[i].shaft_torque_n_m.unwrap_or(0.0)-at(signal::SHAFT_TORQUE, ts),
              at(signal::TURBINE_TORQUE, ts), tt-at(signal::TURBINE_TORQUE, ts), at(signal::OFFGOING_TORQUE, ts), at(signal::OUTPUT_SPEED, ts)/3.0-at(signal::WHEEL_SPEED, ts));
        }
    }
    let _ = ObserverKind::Kalman;
}
