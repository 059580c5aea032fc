//! The functions of FMI 2.0. The caller keeps to the standard in what it points to: so many references and values, strings that end, states
//! that come from here. Null and a wrong order are refused.

use alloc::borrow::ToOwned;
use alloc::boxed::Box;
use alloc::ffi::CString;
use alloc::vec::Vec;
use core::ffi::{CStr, c_char, c_int, c_void};
use core::slice::{from_raw_parts, from_raw_parts_mut};

use crate::instance::{Done, Instance, State};
use crate::log::{ERROR, Log, Logger2};

const OK: c_int = 0;
const NULL: &CStr = c"a pointer is null";
const NO_SPACE: &CStr = c"the place for the bytes of a state is too small";

pub(crate) type Component = *mut Instance;

/// Lets an instance act. An error is reported, and is the status.
///
/// # Safety
/// The component is one that was instantiated here and not yet freed, or null.
pub(crate) unsafe fn with(component: Component, act: impl FnOnce(&mut Instance) -> Done) -> c_int {
    // SAFETY: by the contract of the caller.
    let Some(instance) = (unsafe { component.as_mut() }) else { return ERROR };
    match act(instance) {
        Ok(()) => OK,
        Err(message) => {
            instance.log.error(message);
            ERROR
        }
    }
}

/// Functions of the standard for what this model does not have: whatever their arguments, which are the caller's to remove, they fail.
macro_rules! absent {
    ($($name:ident)+) => { $(
        #[unsafe(no_mangle)]
        extern "C" fn $name() -> c_int {
            ERROR
        }
    )+ };
}
pub(crate) use absent;

#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

/// The functions of the caller that are used: the first and the last member.
#[repr(C)]
struct Callbacks {
    logger: Option<Logger2>,
    _memory: [*const c_void; 2],
    _step_finished: *const c_void,
    environment: *mut c_void,
}

/// The folder of a location such as `file:///opt/a%20b`.
fn folder_at(location: &[u8]) -> Option<Vec<u8>> {
    let location = location.strip_prefix(b"file:")?;
    // An authority, mostly none, is between the second and the third slash.
    let path = match location.strip_prefix(b"//") {
        Some(rest) => rest.get(rest.iter().position(|c| *c == b'/')?..)?,
        None => location,
    };
    // Before the letter of a drive there is another slash.
    let path = if path.get(2) == Some(&b':') { path.get(1..)? } else { path };
    let mut rest = path.iter().copied();
    let mut folder = Vec::with_capacity(path.len());
    while let Some(byte) = rest.next() {
        let mut digit = || char::from(rest.next()?).to_digit(16);
        folder.push(match byte {
            b'%' => (16 * digit()? + digit()?) as u8,
            other => other,
        });
    }
    Some(folder)
}

/// A new instance in a place of its own; an error is reported and gives null.
pub(crate) fn instance(log: Log, made: Done<Instance>) -> Component {
    match made {
        Ok(mut made) => {
            made.log = log;
            Box::into_raw(Box::new(made))
        }
        Err(message) => {
            log.error(message);
            core::ptr::null_mut()
        }
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    guid: *const c_char,
    location: *const c_char,
    callbacks: *const Callbacks,
    _visible: c_int,
    _logging_on: c_int,
) -> Component {
    const CO_SIMULATION: c_int = 1;
    // SAFETY: they are strings and callbacks by the standard, or null.
    let ([name, guid, location], callbacks) = unsafe {
        ([name, guid, location].map(|text| (!text.is_null()).then(|| CStr::from_ptr(text))), callbacks.as_ref())
    };
    let log = match callbacks {
        Some(Callbacks { logger: Some(logger), environment, .. }) => Log::Two {
            logger: *logger,
            environment: *environment,
            name: name.map_or_else(CString::default, CStr::to_owned),
        },
        _ => Log::None,
    };
    let made = || {
        let (Some(guid), Some(location)) = (guid, location) else { return Err(NULL) };
        if kind != CO_SIMULATION {
            return Err(c"the model is one for co-simulation only");
        }
        let folder =
            folder_at(location.to_bytes()).ok_or(c"the location of the resources is not of the form file:///folder")?;
        Instance::new(&folder, guid.to_bytes())
    };
    instance(log, made())
}

#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn fmi2FreeInstance(component: Component) {
    if !component.is_null() {
        // SAFETY: it was instantiated here and is not used any more.
        drop(unsafe { Box::from_raw(component) });
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetDebugLogging(
    component: Component,
    _on: c_int,
    _count: usize,
    _categories: *const *const c_char,
) -> c_int {
    // SAFETY: as the module says; so are those below.
    unsafe { with(component, |_| Ok(())) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetupExperiment(
    component: Component,
    _has_tolerance: c_int,
    _tolerance: f64,
    start_s: f64,
    _has_stop: c_int,
    _stop_s: f64,
) -> c_int {
    // SAFETY: as above.
    unsafe { with(component, |instance| instance.begin_at(start_s)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2EnterInitializationMode(component: Component) -> c_int {
    // SAFETY: as above.
    unsafe { with(component, Instance::enter_initialisation) }
}

#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn fmi2ExitInitializationMode(component: Component) -> c_int {
    // SAFETY: as above.
    unsafe { with(component, Instance::exit_initialisation) }
}

#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn fmi2Terminate(component: Component) -> c_int {
    // SAFETY: as above.
    unsafe { with(component, Instance::terminate) }
}

#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn fmi2Reset(component: Component) -> c_int {
    // SAFETY: as above.
    unsafe { with(component, Instance::reset) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DoStep(component: Component, time_s: f64, length_s: f64, _no_return: c_int) -> c_int {
    // SAFETY: as above.
    unsafe { with(component, |instance| instance.step(time_s, length_s)) }
}

/// Writes the values of so many variables.
///
/// # Safety
/// As the module says.
pub(crate) unsafe fn get<V>(
    component: Component,
    references: *const u32,
    count: usize,
    values: *mut V,
    of: fn(&Instance, u32) -> Done<V>,
) -> c_int {
    let act = |instance: &mut Instance| {
        if count == 0 {
            return Ok(());
        }
        if references.is_null() || values.is_null() {
            return Err(NULL);
        }
        // SAFETY: by the contract of the caller.
        let (references, values) = unsafe { (from_raw_parts(references, count), from_raw_parts_mut(values, count)) };
        references.iter().zip(values).try_for_each(|(reference, value)| {
            *value = of(instance, *reference)?;
            Ok(())
        })
    };
    // SAFETY: by the contract of the caller.
    unsafe { with(component, act) }
}

/// Sets so many inputs.
///
/// # Safety
/// As the module says.
unsafe fn set<V: Copy>(
    component: Component,
    references: *const u32,
    count: usize,
    values: *const V,
    to: fn(&mut Instance, u32, V) -> Done,
) -> c_int {
    let act = |instance: &mut Instance| {
        if count == 0 {
            return Ok(());
        }
        if references.is_null() || values.is_null() {
            return Err(NULL);
        }
        // SAFETY: by the contract of the caller.
        let (references, values) = unsafe { (from_raw_parts(references, count), from_raw_parts(values, count)) };
        references.iter().zip(values).try_for_each(|(reference, value)| to(instance, *reference, *value))
    };
    // SAFETY: by the contract of the caller.
    unsafe { with(component, act) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetReal(
    component: Component,
    references: *const u32,
    count: usize,
    values: *mut f64,
) -> c_int {
    // SAFETY: as above.
    unsafe { get(component, references, count, values, Instance::real) }
}

#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn fmi2SetReal(
    component: Component,
    references: *const u32,
    count: usize,
    values: *const f64,
) -> c_int {
    // SAFETY: as above.
    unsafe { set(component, references, count, values, Instance::set_real) }
}

#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn fmi2GetInteger(
    component: Component,
    references: *const u32,
    count: usize,
    values: *mut c_int,
) -> c_int {
    // SAFETY: as above.
    unsafe { get(component, references, count, values, Instance::whole) }
}

#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn fmi2SetInteger(
    component: Component,
    references: *const u32,
    count: usize,
    values: *const c_int,
) -> c_int {
    // SAFETY: as above.
    unsafe { set(component, references, count, values, Instance::set_whole) }
}

/// Puts a state where the caller wants it: into the state that is there, or into a new one.
///
/// # Safety
/// The place is null, or holds null or a state of this module.
unsafe fn put(place: *mut *mut State, state: State) -> Done {
    // SAFETY: by the contract of the caller.
    unsafe {
        let place = place.as_mut().ok_or(NULL)?;
        match place.as_mut() {
            Some(there) => *there = state,
            None => *place = Box::into_raw(Box::new(state)),
        }
    }
    Ok(())
}

#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn fmi2GetFMUstate(component: Component, state: *mut *mut State) -> c_int {
    // SAFETY: as above.
    unsafe { with(component, |instance| put(state, instance.state()?)) }
}

#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn fmi2SetFMUstate(component: Component, state: *const State) -> c_int {
    // SAFETY: as above.
    unsafe { with(component, |instance| state.as_ref().map(|state| instance.restore(state)).ok_or(NULL)) }
}

#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn fmi2FreeFMUstate(component: Component, state: *mut *mut State) -> c_int {
    let act = |_: &mut Instance| {
        // SAFETY: as above.
        let place = unsafe { state.as_mut() }.ok_or(NULL)?;
        let state = core::mem::replace(place, core::ptr::null_mut());
        if !state.is_null() {
            // SAFETY: as above.
            drop(unsafe { Box::from_raw(state) });
        }
        Ok(())
    };
    // SAFETY: as above.
    unsafe { with(component, act) }
}

#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn fmi2SerializedFMUstateSize(
    component: Component,
    state: *const State,
    size: *mut usize,
) -> c_int {
    let act = |instance: &mut Instance| {
        // SAFETY: as above.
        let (state, size) = unsafe { (state.as_ref().ok_or(NULL)?, size.as_mut().ok_or(NULL)?) };
        *size = instance.serialised(state)?.len();
        Ok(())
    };
    // SAFETY: as above.
    unsafe { with(component, act) }
}

#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn fmi2SerializeFMUstate(
    component: Component,
    state: *const State,
    bytes: *mut u8,
    count: usize,
) -> c_int {
    let act = |instance: &mut Instance| {
        // SAFETY: as above.
        let written = instance.serialised(unsafe { state.as_ref() }.ok_or(NULL)?)?;
        if bytes.is_null() {
            return Err(NULL);
        }
        // SAFETY: as above.
        let bytes = unsafe { from_raw_parts_mut(bytes, count) };
        bytes.get_mut(..written.len()).ok_or(NO_SPACE)?.copy_from_slice(&written);
        Ok(())
    };
    // SAFETY: as above.
    unsafe { with(component, act) }
}

#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn fmi2DeSerializeFMUstate(
    component: Component,
    bytes: *const u8,
    count: usize,
    state: *mut *mut State,
) -> c_int {
    let act = |instance: &mut Instance| {
        if bytes.is_null() {
            return Err(NULL);
        }
        // SAFETY: as above.
        unsafe { put(state, instance.deserialised(from_raw_parts(bytes, count))?) }
    };
    // SAFETY: as above.
    unsafe { with(component, act) }
}

// There are no such variables, no derivatives, and no steps that go on after their call.
absent! { fmi2GetBoolean fmi2SetBoolean fmi2GetString fmi2SetString fmi2GetDirectionalDerivative fmi2SetRealInputDerivatives
fmi2GetRealOutputDerivatives fmi2CancelStep fmi2GetStatus fmi2GetRealStatus fmi2GetIntegerStatus fmi2GetBooleanStatus fmi2GetStringStatus }
// The model is one for co-simulation only; some programs look for these all the same.
absent! { fmi2EnterEventMode fmi2NewDiscreteStates fmi2EnterContinuousTimeMode fmi2CompletedIntegratorStep fmi2SetTime
fmi2SetContinuousStates fmi2GetDerivatives fmi2GetEventIndicators fmi2GetContinuousStates fmi2GetNominalsOfContinuousStates }
