//! The functions of FMI 3.0. What is the same as in FMI 2.0 is called there, with the same contract.

use core::ffi::{CStr, c_char, c_int, c_void};

use crate::fmi2::{self, Component, absent, get, with};
use crate::instance::{Instance, State};
use crate::log::{ERROR, Log, Logger3};

/// Reference of the time.
const TIME: u32 = 0;

#[unsafe(no_mangle)]
extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateCoSimulation(
    _name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: bool,
    _logging_on: bool,
    event_mode_used: bool,
    _early_return_allowed: bool,
    _required: *const u32,
    _required_count: usize,
    environment: *mut c_void,
    logger: Option<Logger3>,
    _intermediate_update: *const c_void,
) -> Component {
    let log = logger.map_or(Log::None, |logger| Log::Three { logger, environment });
    // SAFETY: they are strings by the standard, or null.
    let [token, resources] =
        unsafe { [token, resources].map(|text| (!text.is_null()).then(|| CStr::from_ptr(text).to_bytes())) };
    let made = || {
        let (Some(token), Some(folder)) = (token, resources) else {
            return Err(c"the token or the path of the resources is null");
        };
        if event_mode_used {
            return Err(c"the model has no event mode");
        }
        Instance::new(folder, token)
    };
    fmi2::instance(log, made())
}

/// There is no other kind than co-simulation.
#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateModelExchange() -> Component {
    core::ptr::null_mut()
}

/// See [`fmi3InstantiateModelExchange`].
#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateScheduledExecution() -> Component {
    core::ptr::null_mut()
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeInstance(instance: Component) {
    // SAFETY: that of the same function in FMI 2.0; so are those below.
    unsafe { fmi2::fmi2FreeInstance(instance) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetDebugLogging(
    instance: Component,
    _on: bool,
    _count: usize,
    _categories: *const *const c_char,
) -> c_int {
    // SAFETY: as above.
    unsafe { with(instance, |_| Ok(())) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3EnterInitializationMode(
    instance: Component,
    _has_tolerance: bool,
    _tolerance: f64,
    start_s: f64,
    _has_stop: bool,
    _stop_s: f64,
) -> c_int {
    let act = |instance: &mut Instance| {
        instance.begin_at(start_s)?;
        instance.enter_initialisation()
    };
    // SAFETY: as above.
    unsafe { with(instance, act) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3ExitInitializationMode(instance: Component) -> c_int {
    // SAFETY: as above.
    unsafe { fmi2::fmi2ExitInitializationMode(instance) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3Terminate(instance: Component) -> c_int {
    // SAFETY: as above.
    unsafe { fmi2::fmi2Terminate(instance) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3Reset(instance: Component) -> c_int {
    // SAFETY: as above.
    unsafe { fmi2::fmi2Reset(instance) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetFloat64(
    instance: Component,
    references: *const u32,
    count: usize,
    values: *mut f64,
    value_count: usize,
) -> c_int {
    let of = |instance: &Instance, reference| match reference {
        TIME => Ok(instance.time_s),
        other => instance.real(other),
    };
    // SAFETY: as above.
    if count == value_count { unsafe { get(instance, references, count, values, of) } } else { ERROR }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetFloat64(
    instance: Component,
    references: *const u32,
    count: usize,
    values: *const f64,
    value_count: usize,
) -> c_int {
    // SAFETY: as above.
    if count == value_count { unsafe { fmi2::fmi2SetReal(instance, references, count, values) } } else { ERROR }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetInt32(
    instance: Component,
    references: *const u32,
    count: usize,
    values: *mut i32,
    value_count: usize,
) -> c_int {
    // SAFETY: as above.
    if count == value_count { unsafe { fmi2::fmi2GetInteger(instance, references, count, values) } } else { ERROR }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetInt32(
    instance: Component,
    references: *const u32,
    count: usize,
    values: *const i32,
    value_count: usize,
) -> c_int {
    // SAFETY: as above.
    if count == value_count { unsafe { fmi2::fmi2SetInteger(instance, references, count, values) } } else { ERROR }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DoStep(
    instance: Component,
    time_s: f64,
    length_s: f64,
    _no_earlier_state: bool,
    event_needed: *mut bool,
    terminate: *mut bool,
    early_return: *mut bool,
    last_s: *mut f64,
) -> c_int {
    // SAFETY: by the standard they are places for the results, or null.
    unsafe {
        for flag in [event_needed, terminate, early_return] {
            if !flag.is_null() {
                flag.write(false);
            }
        }
        let act = |instance: &mut Instance| {
            let stepped = instance.step(time_s, length_s);
            if !last_s.is_null() {
                last_s.write(instance.time_s);
            }
            stepped
        };
        with(instance, act)
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetFMUState(instance: Component, state: *mut *mut State) -> c_int {
    // SAFETY: as above.
    unsafe { fmi2::fmi2GetFMUstate(instance, state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetFMUState(instance: Component, state: *const State) -> c_int {
    // SAFETY: as above.
    unsafe { fmi2::fmi2SetFMUstate(instance, state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeFMUState(instance: Component, state: *mut *mut State) -> c_int {
    // SAFETY: as above.
    unsafe { fmi2::fmi2FreeFMUstate(instance, state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SerializedFMUStateSize(instance: Component, state: *const State, size: *mut usize) -> c_int {
    // SAFETY: as above.
    unsafe { fmi2::fmi2SerializedFMUstateSize(instance, state, size) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SerializeFMUState(
    instance: Component,
    state: *const State,
    bytes: *mut u8,
    count: usize,
) -> c_int {
    // SAFETY: as above.
    unsafe { fmi2::fmi2SerializeFMUstate(instance, state, bytes, count) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DeserializeFMUState(
    instance: Component,
    bytes: *const u8,
    count: usize,
    state: *mut *mut State,
) -> c_int {
    // SAFETY: as above.
    unsafe { fmi2::fmi2DeSerializeFMUstate(instance, bytes, count, state) }
}

// There are no variables of these types, no events, clocks, continuous states and derivatives.
absent! { fmi3EnterEventMode fmi3EnterStepMode fmi3EnterConfigurationMode fmi3ExitConfigurationMode fmi3GetFloat32 fmi3SetFloat32
fmi3GetInt8 fmi3SetInt8 fmi3GetUInt8 fmi3SetUInt8 fmi3GetInt16 fmi3SetInt16 fmi3GetUInt16 fmi3SetUInt16 fmi3GetUInt32 fmi3SetUInt32
fmi3GetInt64 fmi3SetInt64 fmi3GetUInt64 fmi3SetUInt64 fmi3GetBoolean fmi3SetBoolean fmi3GetString fmi3SetString fmi3GetBinary
fmi3SetBinary fmi3GetClock fmi3SetClock fmi3GetNumberOfVariableDependencies fmi3GetVariableDependencies fmi3GetDirectionalDerivative
fmi3GetAdjointDerivative fmi3GetIntervalDecimal fmi3GetIntervalFraction fmi3GetShiftDecimal fmi3GetShiftFraction
fmi3SetIntervalDecimal fmi3SetIntervalFraction fmi3SetShiftDecimal fmi3SetShiftFraction fmi3EvaluateDiscreteStates
fmi3UpdateDiscreteStates fmi3EnterContinuousTimeMode fmi3CompletedIntegratorStep fmi3SetTime fmi3SetContinuousStates
fmi3GetContinuousStateDerivatives fmi3GetEventIndicators fmi3GetContinuousStates fmi3GetNominalsOfContinuousStates
fmi3GetNumberOfEventIndicators fmi3GetNumberOfContinuousStates fmi3GetOutputDerivatives fmi3ActivateModelPartition }
