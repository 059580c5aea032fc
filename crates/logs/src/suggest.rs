//! A first channel map from names and units.

use std::fmt::Write as _;

use trace::{Quantity, Unit};

use crate::{Channel, Role, error};

/// Words that speak for a role, and words that speak against it. A word of a name counts where it is one of these; an ending `*`
/// stands for any end.
struct Words {
    role: Role,
    /// Each group must be met by a word.
    all: &'static [&'static [&'static str]],
    none: &'static [&'static str],
    /// Names that are enough by themselves.
    exact: &'static [&'static str],
}

const ENGINE: &[&str] = &["engine", "eng", "mot", "motor", "ice", "crank", "vkm"];
const SPEED: &[&str] = &["speed", "spd", "n", "rpm", "drehzahl", "nd", "revs", "rad"];
const TURBINE: &[&str] =
    &["turbine", "turb", "tur", "trb", "turbinen*", "input", "nt", "gearboxinput", "transinput", "getriebeeingang*"];
const TORQUE: &[&str] = &["torque", "tq", "trq", "tqi", "moment", "drehmoment", "md", "m"];
const OUTPUT: &[&str] = &["output", "abtrieb", "abtriebs*", "out", "nab", "getriebeausgang*"];
const WHEEL: &[&str] = &["wheel", "whl", "rad", "raddrehzahl", "radgeschw*", "whlspd", "hr", "hl"];
const CURRENT: &[&str] = &["current", "cur", "strom", "curr", "i", "ventilstrom", "solenoid", "sol", "amp"];
const CLUTCH: &[&str] = &["oncoming", "clutch", "kupplung", "kup", "cl", "solenoid", "sol", "ventil*", "valve", "vfs"];
const GEAR: &[&str] = &["gear", "gang", "gr", "gearcurrent"];
const TARGET: &[&str] = &["target", "soll", "ziel", "des", "desired", "cmd", "commanded", "req", "tar", "trg", "tgt"];
const ACTUAL: &[&str] = &["actual", "ist", "cur", "current", "engaged", "act", "currentgear"];
const SHIFT: &[&str] = &["shift", "schalt*", "shiftinprogress", "shifting"];

const TABLE: &[Words] = &[
    Words {
        role: Role::EngineSpeed,
        all: &[ENGINE, SPEED],
        none: &["target", "soll", "desired", "idle", "limit"],
        exact: &["n", "n_mot", "nmot", "nmot_w", "neng", "rpm", "enginespeed", "motordrehzahl"],
    },
    Words {
        role: Role::TurbineSpeed,
        all: &[TURBINE, SPEED],
        none: &["target", "soll", "engine"],
        exact: &["nt", "n_t", "nin", "n_in", "nturb", "nturbine", "turbinespeed", "turbinendrehzahl", "n_turbine"],
    },
    Words {
        role: Role::OutputSpeed,
        all: &[OUTPUT, SPEED],
        none: &["target", "soll", "torque"],
        exact: &["nab", "n_ab", "nout", "n_out", "outputspeed", "abtriebsdrehzahl"],
    },
    Words {
        role: Role::WheelSpeed,
        all: &[WHEEL, &["speed", "spd", "n", "drehzahl", "v", "rr", "rl", "hr", "hl", "raddrehzahl", "radgeschw*"]],
        none: &["fl", "fr", "vl", "vr", "steering", "front", "lenk*"],
        exact: &["wheelspeed", "whlspd", "raddrehzahl"],
    },
    Words {
        role: Role::VehicleSpeed,
        all: &[
            &["vehicle", "veh", "car", "fahrzeug*", "vs", "vss"],
            &["speed", "spd", "v", "geschwindigkeit", "kmh", "vs", "vss"],
        ],
        none: &["target", "soll", "cruise"],
        exact: &["vehiclespeed", "vfzg", "v_fzg", "vveh", "v_veh", "geschwindigkeit", "vs"],
    },
    Words {
        role: Role::VehicleAcceleration,
        all: &[
            &["acc", "accel", "acceleration", "beschl", "beschleunigung", "ax", "a"],
            &["long", "longitudinal", "laengs", "x", "vehicle", "ax"],
        ],
        none: &["pedal", "ped", "lat", "lateral"],
        exact: &["ax", "a_x", "along", "laengsbeschleunigung"],
    },
    Words {
        role: Role::OncomingCurrent,
        all: &[CURRENT, CLUTCH],
        none: &["offgoing", "off", "line", "tcc", "lockup", "battery"],
        exact: &[],
    },
    Words { role: Role::OffgoingCurrent, all: &[CURRENT, &["offgoing", "off"]], none: &[], exact: &[] },
    Words {
        role: Role::OncomingDuty,
        all: &[&["duty", "tastverhaeltnis", "pwm"], CLUTCH],
        none: &["offgoing", "off", "line", "tcc", "lockup"],
        exact: &[],
    },
    Words {
        role: Role::OffgoingDuty,
        all: &[&["duty", "tastverhaeltnis", "pwm"], &["offgoing", "off"]],
        none: &[],
        exact: &[],
    },
    Words {
        role: Role::OncomingPressureCommand,
        all: &[&["pressure", "druck", "p", "prs"], CLUTCH, TARGET],
        none: &["line", "oil", "fuel"],
        exact: &[],
    },
    Words {
        role: Role::OncomingPressure,
        all: &[&["pressure", "druck", "p", "prs"], CLUTCH],
        none: &["line", "oil", "fuel", "soll", "target", "offgoing"],
        exact: &[],
    },
    Words { role: Role::OncomingTorque, all: &[TORQUE, CLUTCH], none: &["offgoing", "engine"], exact: &[] },
    Words {
        role: Role::EngineTorque,
        all: &[TORQUE, ENGINE],
        none: &[
            "friction",
            "reib*",
            "loss",
            "verlust",
            "max",
            "min",
            "ref",
            "reference",
            "target",
            "soll",
            "req",
            "indicated",
            "ind",
        ],
        exact: &["tqi", "md_mot", "mmot", "enginetorque", "motormoment"],
    },
    Words {
        role: Role::EngineFrictionTorque,
        all: &[TORQUE, &["friction", "reib*", "loss", "verlust", "schlepp*"]],
        none: &["clutch", "kupplung", "gear", "getriebe"],
        exact: &[],
    },
    Words {
        role: Role::TorqueReductionRequest,
        all: &[TORQUE, &["reduction", "red", "eingriff", "intervention"], &["request", "req", "anforderung", "soll"]],
        none: &["asr", "esp", "tcs"],
        exact: &[],
    },
    Words {
        role: Role::Throttle,
        all: &[&[
            "throttle",
            "drossel*",
            "dk",
            "tps",
            "accelerator",
            "fahrpedal",
            "pedal",
            "ped",
            "wped",
            "app",
            "apps",
        ]],
        none: &["target", "soll", "brake", "brk", "clutch", "kick"],
        exact: &["wped", "wdk", "tps"],
    },
    Words {
        role: Role::TargetGear,
        all: &[GEAR, TARGET],
        none: &["ratio", "actual", "ist"],
        exact: &["targetgear", "zielgang", "sollgang"],
    },
    Words {
        role: Role::Gear,
        all: &[GEAR, ACTUAL],
        none: &["target", "soll", "ziel", "ratio", "sel", "lever", "desired"],
        exact: &["gear", "gang", "currentgear", "istgang", "gangist"],
    },
    Words {
        role: Role::ShiftActive,
        all: &[SHIFT, &["active", "aktiv", "progress", "flag", "state", "laeuft", "in"]],
        none: &["lever", "light"],
        exact: &["shiftinprogress", "schaltung_aktiv"],
    },
    Words {
        role: Role::Selector,
        all: &[&["selector", "lever", "prnd", "waehlhebel", "sel"]],
        none: &["speed"],
        exact: &[],
    },
    Words {
        role: Role::LockUpApplied,
        all: &[
            &["tcc", "lockup", "lock", "wk", "wandlerkupplung*"],
            &["applied", "active", "aktiv", "state", "status", "locked", "closed", "zu", "geschlossen"],
        ],
        none: &["door", "diff", "slip", "pressure", "current"],
        exact: &["lockup", "tcc", "wk_zu"],
    },
    Words {
        role: Role::OilTemperature,
        all: &[&["temp", "temperature", "temperatur", "t"], &["oil", "oel", "trans", "getriebe", "atf", "tcu", "at"]],
        none: &["engine", "mot", "water", "coolant"],
        exact: &["atf_temp", "toel"],
    },
];

/// The words of a name: divided at signs, before capitals and at the ends of numbers, in small letters.
fn words(name: &str) -> Vec<String> {
    let plain = name
        .replace('ä', "ae")
        .replace('ö', "oe")
        .replace('ü', "ue")
        .replace('Ä', "Ae")
        .replace('Ö', "Oe")
        .replace('Ü', "Ue")
        .replace('ß', "ss");
    let mut words = vec![String::new()];
    let mut before = ' ';
    for c in plain.chars() {
        let starts = c.is_uppercase() && before.is_lowercase() || c.is_ascii_digit() != before.is_ascii_digit();
        if (starts || !c.is_alphanumeric()) && words.last().is_some_and(|word| !word.is_empty()) {
            words.push(String::new());
        }
        if c.is_alphanumeric()
            && let Some(word) = words.last_mut()
        {
            word.extend(c.to_lowercase());
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    words
}

fn met(list: &[&str], words: &[String]) -> bool {
    list.iter().any(|wanted| match wanted.strip_suffix('*') {
        Some(start) => words.iter().any(|word| word.starts_with(start)),
        None => words.iter().any(|word| word == wanted),
    })
}

/// How well a channel fits a role; none if not at all.
fn fit(entry: &Words, channel: &Channel) -> Option<u32> {
    let words = words(&channel.name);
    let joined = words.concat();
    let exact = entry.exact.iter().any(|name| name.replace('_', "") == joined);
    if met(entry.none, &words) || !(exact || entry.all.iter().all(|list| met(list, &words))) {
        return None;
    }
    let unit = Unit::parse(&channel.unit).filter(|_| !channel.unit.trim().is_empty());
    let unit_fits = match (entry.role.quantity(), unit) {
        (None, None) => 2,
        (None, Some(unit)) if unit.quantity == Quantity::Share => 2,
        (Some(wanted), Some(unit)) if wanted == unit.quantity => 4,
        (Some(Quantity::Rotation), Some(unit))
            if entry.role == Role::WheelSpeed && unit.quantity == Quantity::Velocity =>
        {
            3
        }
        (Some(_), None) => 1,
        // Per cent of a torque that the name does not tell.
        (Some(Quantity::Torque), Some(unit)) if unit.quantity == Quantity::Share => 0,
        _ => return None,
    };
    Some(unit_fits + if exact { 3 } else { 0 } + if words.len() <= 3 { 1 } else { 0 })
}

/// From so many commands of elements on they are those of a whole gearbox.
const WHOLE_GEARBOX: usize = 3;

/// The element whose valve has this command, and the role; none if the channel is no such command.
fn element(channel: &Channel) -> Option<(Role, String)> {
    const ELEMENT: &[&str] = &["element", "brake", "bremse", "elem"];
    const UNITS: [&str; 2] = ["a", "ma"];
    let name = channel.name.to_lowercase();
    let own = name.strip_prefix("element_").and_then(|rest| {
        let current = ["_current_a", "_current_ma"].into_iter().find_map(|ending| rest.strip_suffix(ending));
        let duty = || rest.strip_suffix("_duty_percent");
        current.map(|name| (Role::ElementCurrent, name)).or_else(|| Some((Role::ElementDuty, duty()?)))
    });
    if let Some((role, name)) = own {
        return Some((role, name.to_owned()));
    }
    let words = words(&channel.name);
    let is_about = |list: &[&str]| met(list, &words);
    let unit = Unit::parse(&channel.unit).filter(|unit| unit.quantity == Quantity::Current)?;
    let is_command = is_about(CURRENT) && (is_about(CLUTCH) || is_about(ELEMENT));
    if unit.quantity != Quantity::Current
        || !is_command
        || is_about(&["line", "tcc", "lockup", "battery", "off", "offgoing", "oncoming"])
    {
        return None;
    }
    let is_name = |word: &&String| {
        let word = std::slice::from_ref(*word);
        ![CURRENT, CLUTCH, ELEMENT, TARGET, ACTUAL].iter().any(|list| met(list, word))
    };
    let mut named: Vec<&str> = words.iter().filter(is_name).map(String::as_str).collect();
    if named.len() > 1 && named.last().is_some_and(|word| UNITS.contains(word)) {
        named.pop();
    }
    let name = named.concat();
    (1..=3).contains(&name.len()).then_some((Role::ElementCurrent, name))
}

/// The commands of the elements of a whole gearbox: their keys in a map, and their channels. None if there are but a few, or two
/// with one key.
fn elements(channels: &[Channel]) -> Vec<(String, usize)> {
    let key = |(at, channel)| {
        let (role, name) = element(channel)?;
        let what = if role == Role::ElementDuty { "duty" } else { "current" };
        Some((format!("element_{name}_{what}"), at))
    };
    let found: Vec<(String, usize)> = channels.iter().enumerate().filter_map(key).collect();
    let keys: std::collections::BTreeSet<&str> = found.iter().map(|(key, _)| key.as_str()).collect();
    if keys.len() == found.len() && found.len() >= WHOLE_GEARBOX { found } else { Vec::new() }
}

/// Unused channels that are named at most; a bus has hundreds.
const UNUSED: usize = 20;

/// A channel map for a log, as the text of a TOML file. Channels in doubt stand beside it as comments.
pub fn suggest(channels: &[Channel], dbc: Option<&str>) -> String {
    let mut text = String::from("# A first channel map, from names and units alone: check every line.\n");
    if let Some(dbc) = dbc {
        let _ = writeln!(text, "dbc = {}", quoted(dbc));
    }
    let mut missing = Vec::new();
    let mut taken = vec![false; channels.len()];
    let elements = elements(channels);
    elements.iter().for_each(|(_, at)| taken[*at] = true);
    for entry in TABLE {
        let mut found: Vec<(u32, usize)> = channels
            .iter()
            .enumerate()
            .filter(|(i, _)| !taken[*i])
            .filter_map(|(i, channel)| fit(entry, channel).map(|fit| (fit, i)))
            .collect();
        found.sort_by_key(|(fit, i)| (std::cmp::Reverse(*fit), *i));
        let Some(&(_, best)) = found.first() else {
            if elements.is_empty() || !entry.role.is_command() {
                missing.push(entry.role.name());
            }
            continue;
        };
        taken[best] = true;
        text += &table_of(entry.role.name(), entry.role, best, channels);
        let others: Vec<String> = found.iter().skip(1).take(4).map(|(_, i)| error::shown(&channels[*i].name)).collect();
        if !others.is_empty() {
            let _ = writeln!(text, "# also fits: {}", others.join(", "));
        }
    }
    if !elements.is_empty() {
        text.push_str(
            "\n# Commands of the elements of a whole gearbox: check that these are the names of the gearbox file.\n",
        );
    }
    for (key, at) in &elements {
        let role = if key.ends_with("duty") { Role::ElementDuty } else { Role::ElementCurrent };
        text += &table_of(key, role, *at, channels);
    }
    if !missing.is_empty() {
        let _ = writeln!(text, "\n# No channel was found for: {}", missing.join(", "));
    }
    let unused: Vec<String> = channels
        .iter()
        .zip(&taken)
        .filter(|(_, taken)| !**taken)
        .map(|(channel, _)| error::shown(&channel.name))
        .collect();
    if !unused.is_empty() {
        let more = if unused.len() > UNUSED { ", ..." } else { "" };
        let _ = writeln!(text, "# Channels that are not used: {}{more}", unused[..unused.len().min(UNUSED)].join(", "));
    }
    text
}

/// The table of a channel in a map.
fn table_of(key: &str, role: Role, at: usize, channels: &[Channel]) -> String {
    let channel = &channels[at];
    let mut text = format!("\n[channel.{key}]\nname = {}\n", quoted(&channel.name));
    if channels.iter().filter(|other| other.name == channel.name).count() > 1 {
        let _ = writeln!(text, "group = {}", quoted(&channel.group));
    }
    match Unit::parse(&channel.unit) {
        Some(Unit { quantity: Quantity::Share, .. }) if role.quantity() == Some(Quantity::Torque) => {
            let _ = writeln!(
                text,
                "unit = \"N m\"\nscale = 1.0 # the log has {}: check, N m for each",
                error::shown(&channel.unit)
            );
        }
        Some(_) if !channel.unit.trim().is_empty() => {
            let _ = writeln!(text, "# unit of the log: {}", error::shown(&channel.unit));
        }
        _ if role.quantity().is_some() => {
            let _ = writeln!(text, "unit = {} # the log does not say it: check", quoted(role.unit()));
        }
        _ => {}
    }
    text
}

/// A text as TOML writes it.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(name: &str, unit: &str) -> Channel {
        Channel { name: name.to_owned(), unit: unit.to_owned(), group: String::new() }
    }

    /// The channel that is suggested for each role.
    fn suggested(channels: &[Channel]) -> Vec<(String, String)> {
        let text = suggest(channels, None);
        let table: toml::Table = text.parse().unwrap();
        let channels = table.get("channel").and_then(|value| value.as_table()).cloned().unwrap_or_default();
        channels.into_iter().map(|(role, entry)| (role, entry["name"].as_str().unwrap().to_owned())).collect()
    }

    #[test]
    fn usual_names_in_two_languages_are_found() {
        let logs: [&[(&str, &str, &str)]; 8] = [
            &[
                ("N_Eng", "rpm", "engine_speed"),
                ("N_Turb", "rpm", "turbine_speed"),
                ("N_Out", "rpm", "output_speed"),
                ("GearCurrent", "", "gear"),
            ],
            &[
                ("Motordrehzahl", "1/min", "engine_speed"),
                ("Turbinendrehzahl", "1/min", "turbine_speed"),
                ("Abtriebsdrehzahl", "1/min", "output_speed"),
                ("Zielgang", "", "target_gear"),
                ("Ventilstrom_Kupplung_B", "mA", "oncoming_current"),
            ],
            &[
                ("EngineSpeed", "rpm", "engine_speed"),
                ("TurbineSpeed", "rpm", "turbine_speed"),
                ("VehicleSpeed", "km/h", "vehicle_speed"),
                ("TargetGear", "", "target_gear"),
                ("CurrentGear", "", "gear"),
                ("EngineTorque", "Nm", "engine_torque"),
                ("OilTemperature", "degC", "oil_temperature"),
            ],
            &[
                ("engine_speed_rad_s", "rad/s", "engine_speed"),
                ("turbine_speed_rad_s", "rad/s", "turbine_speed"),
                ("output_speed_rad_s", "rad/s", "output_speed"),
                ("wheel_speed_rad_s", "rad/s", "wheel_speed"),
                ("oncoming_current_a", "A", "oncoming_current"),
                ("offgoing_current_a", "A", "offgoing_current"),
                ("throttle", "", "throttle"),
            ],
            &[("I_ClA", "mA", "oncoming_current"), ("I_ClA_off", "mA", "offgoing_current"), ("APP", "%", "throttle")],
            &[
                ("SolCurr_A", "mA", "element_a_current"),
                ("SolCurr_B", "mA", "element_b_current"),
                ("SolCurr_C", "mA", "element_c_current"),
                ("Gear_Tgt", "", "target_gear"),
                ("AccPed", "%", "throttle"),
                ("BrkPed", "%", ""),
            ],
            &[
                ("element_a_current_a", "A", "element_a_current"),
                ("element_b_duty_percent", "%", "element_b_duty"),
                ("element_35r_current_ma", "mA", "element_35r_current"),
                ("lock_up_applied", "", "lock_up_applied"),
                ("oncoming_current_a", "A", "oncoming_current"),
            ],
            &[
                ("I_ClA", "mA", "element_a_current"),
                ("Solenoid_B1_Current_A", "A", "element_b1_current"),
                ("Kupplung_E_Strom_Ist", "mA", "element_e_current"),
                ("TCC_State", "", "lock_up_applied"),
                ("TCC_Sol_Current", "mA", ""),
            ],
        ];
        for log in logs {
            let found = suggested(&log.iter().map(|(name, unit, _)| channel(name, unit)).collect::<Vec<_>>());
            for (name, _, role) in log.iter().filter(|(.., role)| !role.is_empty()) {
                assert!(found.contains(&((*role).to_owned(), (*name).to_owned())), "{name}: {found:?}");
            }
            assert_eq!(found.len(), log.iter().filter(|(.., role)| !role.is_empty()).count(), "{found:?}");
        }
    }

    #[test]
    fn the_input_of_a_gearbox_is_found_and_unused_channels_are_named() {
        let text = suggest(&[channel("N_In", "1/min"), channel("I_K1", "mA"), channel("Wiper", "")], None);
        assert!(text.contains("[channel.turbine_speed]\nname = \"N_In\""), "{text}");
        assert!(text.ends_with("# Channels that are not used: I_K1, Wiper\n"), "{text}");
        let many: Vec<Channel> = (0..30).map(|at| channel(&format!("Signal{at}"), "")).collect();
        assert!(suggest(&many, None).ends_with("Signal19, ...\n"));
    }

    #[test]
    fn a_name_with_quotation_marks_stays_a_name() {
        let found = suggested(&[channel("Engine \"speed\" \\ n", "rpm")]);
        assert_eq!(found, [("engine_speed".to_owned(), "Engine \"speed\" \\ n".to_owned())]);
    }
}
