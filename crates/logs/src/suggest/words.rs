//! Words of names that speak for a role, in English, German, and of the standards of lorries and of diagnosis.

use crate::Role;

/// Words that speak for a role, and words that speak against it. A word of a name counts where it is one of these; an ending `*`
/// stands for any end.
pub(super) struct Words {
    pub(super) role: Role,
    /// Each group must be met by a word.
    pub(super) all: &'static [&'static [&'static str]],
    pub(super) none: &'static [&'static str],
    /// Names that are enough by themselves.
    pub(super) exact: &'static [&'static str],
    /// Short names that are enough where no other channel fits.
    pub(super) vague: &'static [&'static str],
}

pub(super) const ENGINE: &[&str] = &["engine", "eng", "mot", "motor", "ice", "crank", "vkm"];
pub(super) const SPEED: &[&str] = &["speed", "spd", "n", "rpm", "drehzahl", "nd", "revs", "rad"];
pub(super) const TURBINE: &[&str] =
    &["turbine", "turb", "tur", "trb", "turbinen*", "input", "nt", "gearboxinput", "transinput", "getriebeeingang*"];
pub(super) const ACCELERATION: &[&str] = &["acc", "accel", "acceleration", "beschl", "beschleunigung", "ax", "a"];
pub(super) const TORQUE: &[&str] = &["torque", "tq", "trq", "tqi", "moment", "drehmoment", "md", "m"];
pub(super) const OUTPUT: &[&str] = &["output", "abtrieb", "abtriebs*", "out", "nab", "getriebeausgang*"];
pub(super) const WHEEL: &[&str] = &["wheel", "whl", "rad", "raddrehzahl", "radgeschw*", "whlspd", "hr", "hl"];
pub(super) const CURRENT: &[&str] = &["current", "cur", "strom", "curr", "i", "ventilstrom", "solenoid", "sol", "amp"];
pub(super) const CLUTCH: &[&str] =
    &["oncoming", "clutch", "kupplung", "kup", "cl", "solenoid", "sol", "ventil*", "valve", "vfs"];
pub(super) const GEAR: &[&str] = &["gear", "gang", "gr", "gearcurrent"];
pub(super) const TARGET: &[&str] =
    &["target", "soll", "ziel", "des", "desired", "cmd", "commanded", "req", "tar", "trg", "tgt"];
pub(super) const ACTUAL: &[&str] = &["actual", "ist", "cur", "current", "engaged", "act", "currentgear"];
pub(super) const SHIFT: &[&str] = &["shift", "schalt*", "shiftinprogress", "shifting"];

pub(super) const TABLE: &[Words] = &[
    Words {
        role: Role::EngineSpeed,
        all: &[ENGINE, SPEED],
        none: &[
            "target",
            "soll",
            "desired",
            "idle",
            "limit",
            "requested",
            "rqst",
            "req",
            "fan",
            "turbo*",
            "pump",
            "max",
            "min",
        ],
        exact: &["n", "n_mot", "nmot", "nmot_w", "neng", "rpm", "enginespeed", "enginerpm", "motordrehzahl"],
        vague: &[],
    },
    Words {
        role: Role::TurbineSpeed,
        all: &[TURBINE, SPEED],
        none: &["target", "soll", "engine"],
        exact: &[
            "nt",
            "n_t",
            "nin",
            "n_in",
            "nturb",
            "nturbine",
            "turbinespeed",
            "turbinendrehzahl",
            "n_turbine",
            "getriebeeingangsdrehzahl",
        ],
        vague: &[],
    },
    Words {
        role: Role::OutputSpeed,
        all: &[OUTPUT, SPEED],
        none: &["target", "soll", "torque"],
        exact: &["nab", "n_ab", "nout", "n_out", "outputspeed", "abtriebsdrehzahl", "getriebeausgangsdrehzahl"],
        vague: &[],
    },
    Words {
        role: Role::WheelSpeed,
        all: &[WHEEL, &["speed", "spd", "n", "drehzahl", "v", "rr", "rl", "hr", "hl", "raddrehzahl", "radgeschw*"]],
        none: &["fl", "fr", "vl", "vr", "steering", "front", "lenk*", "based", "vehicle", "veh", "relative"],
        exact: &["wheelspeed", "whlspd", "raddrehzahl"],
        vague: &[],
    },
    Words {
        role: Role::VehicleSpeed,
        all: &[
            &["vehicle", "veh", "car", "fahrzeug*", "vs", "vss"],
            &["speed", "spd", "v", "geschwindigkeit", "kmh", "vs", "vss"],
        ],
        none: &["target", "soll", "cruise", "limit", "max", "set"],
        exact: &[
            "vehiclespeed",
            "vfzg",
            "v_fzg",
            "vveh",
            "v_veh",
            "geschwindigkeit",
            "fahrzeuggeschwindigkeit",
            "fahrgeschwindigkeit",
            "vs",
            "vehspd",
            "vehspeed",
            "vspd",
            "vspeed",
        ],
        vague: &[
            "v",
            "v_kmh",
            "v_km_h",
            "v_kph",
            "v_mph",
            "v_m_s",
            "speed",
            "speed_kmh",
            "speed_km_h",
            "speed_kph",
            "speed_mph",
            "speed_m_s",
            "gps_speed",
            "gps_speed_kmh",
            "gps_speed_km_h",
            "gps_speed_kph",
            "gps_speed_mph",
            "gps_speed_m_s",
        ],
    },
    Words {
        role: Role::VehicleAcceleration,
        all: &[ACCELERATION, &["vehicle"]],
        none: &["pedal", "ped", "lat", "lateral", "long", "longitudinal", "laengs", "x", "ax"],
        exact: &[],
        vague: &[],
    },
    Words {
        role: Role::LongitudinalAcceleration,
        all: &[ACCELERATION, &["long", "longitudinal", "laengs", "x", "ax"]],
        none: &["pedal", "ped", "lat", "lateral"],
        exact: &["ax", "a_x", "along", "laengsbeschleunigung"],
        vague: &[],
    },
    Words {
        role: Role::OncomingCurrent,
        all: &[CURRENT, CLUTCH],
        none: &["offgoing", "off", "line", "tcc", "lockup", "battery"],
        exact: &[],
        vague: &[],
    },
    Words { role: Role::OffgoingCurrent, all: &[CURRENT, &["offgoing", "off"]], none: &[], exact: &[], vague: &[] },
    Words {
        role: Role::OncomingDuty,
        all: &[&["duty", "tastverhaeltnis", "pwm"], CLUTCH],
        none: &["offgoing", "off", "line", "tcc", "lockup"],
        exact: &[],
        vague: &[],
    },
    Words {
        role: Role::OffgoingDuty,
        all: &[&["duty", "tastverhaeltnis", "pwm"], &["offgoing", "off"]],
        none: &[],
        exact: &[],
        vague: &[],
    },
    Words {
        role: Role::OncomingPressureCommand,
        all: &[&["pressure", "druck", "p", "prs"], CLUTCH, TARGET],
        none: &["line", "oil", "fuel"],
        exact: &[],
        vague: &[],
    },
    Words {
        role: Role::OncomingPressure,
        all: &[&["pressure", "druck", "p", "prs"], CLUTCH],
        none: &["line", "oil", "fuel", "soll", "target", "offgoing"],
        exact: &[],
        vague: &[],
    },
    Words { role: Role::OncomingTorque, all: &[TORQUE, CLUTCH], none: &["offgoing", "engine"], exact: &[], vague: &[] },
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
            "requested",
            "rqst",
            "demand*",
            "desired",
            "wunsch*",
            "limit",
            "mode",
            "fan",
        ],
        exact: &["tqi", "md_mot", "mmot", "enginetorque", "motormoment", "motordrehmoment"],
        vague: &["tq", "trq", "md", "torque"],
    },
    Words {
        role: Role::EngineFrictionTorque,
        all: &[TORQUE, &["friction", "reib*", "loss", "verlust", "schlepp*"]],
        none: &["clutch", "kupplung", "gear", "getriebe"],
        exact: &[],
        vague: &[],
    },
    Words {
        role: Role::TorqueReductionRequest,
        all: &[TORQUE, &["reduction", "red", "eingriff", "intervention"], &["request", "req", "anforderung", "soll"]],
        none: &["asr", "esp", "tcs"],
        exact: &[],
        vague: &[],
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
            "gaspedal*",
            "fahrpedal*",
            "pedalwert*",
        ]],
        none: &["target", "soll", "brake", "brk", "clutch", "kick", "switch", "idle", "volt*"],
        // A threshold is `thr`, too.
        exact: &["wped", "wdk", "tps", "thr", "thr_pos", "thr_act", "thr_angle"],
        vague: &[],
    },
    Words {
        role: Role::TargetGear,
        all: &[GEAR, TARGET],
        none: &["ratio", "actual", "ist"],
        exact: &["targetgear", "zielgang", "sollgang", "t_gear", "transselectedgear", "transmissionselectedgear"],
        vague: &[],
    },
    Words {
        role: Role::Gear,
        all: &[GEAR, ACTUAL],
        none: &["target", "soll", "ziel", "ratio", "sel", "lever", "desired"],
        exact: &["gear", "gang", "currentgear", "istgang", "gangist"],
        vague: &[],
    },
    Words {
        role: Role::ShiftActive,
        all: &[SHIFT, &["active", "aktiv", "progress", "flag", "state", "laeuft", "in"]],
        none: &["lever", "light", "park"],
        exact: &["shiftinprogress", "schaltung_aktiv"],
        vague: &[],
    },
    Words {
        role: Role::Selector,
        all: &[&["selector", "lever", "prnd", "waehlhebel", "sel"]],
        none: &["speed"],
        exact: &[],
        vague: &[],
    },
    Words {
        role: Role::LockUpApplied,
        all: &[
            &["tcc", "lockup", "lock", "wk", "wandlerkupplung*"],
            &[
                "applied",
                "active",
                "aktiv",
                "state",
                "status",
                "locked",
                "closed",
                "engaged",
                "zu",
                "geschlossen",
                "on",
                "ein",
            ],
        ],
        none: &["door", "diff", "slip", "pressure", "current"],
        exact: &["lockup", "tcc", "wk_zu"],
        vague: &[],
    },
    Words {
        role: Role::OilTemperature,
        all: &[
            &["temp", "temperature", "temperatur", "t", "getriebeoeltemp*"],
            &["oil", "oel", "trans", "getriebe", "atf", "tcu", "at", "getriebeoel*"],
        ],
        none: &["engine", "eng", "mot", "motor*", "water", "coolant", "axle", "diff", "brake"],
        exact: &["atf_temp", "toel", "tot"],
        vague: &[],
    },
];
