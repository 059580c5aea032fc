//! What has no C is refused with its reason.

use c99::{Documentation, Error, stack, translate};

use crate::module::{F32, F64, Function, I32, constant, module};

fn refused(module: &[u8]) -> Error {
    translate(module, "", "", &Documentation::default()).unwrap_err()
}

fn refused_body(parameters: &[u8], results: &[u8], body: &[u8]) -> Error {
    refused(&module(&[Function::new("f", parameters, results, body)], 64, None))
}

#[test]
fn what_is_no_module_is_refused() {
    let sound = module(&[Function::new("f", &[], &[I32], &constant(3))], 64, None);
    translate(&sound, "", "", &Documentation::default()).unwrap();
    for bytes in [&b""[..], b"\0asm", b"int main(void) { return 0; }", &sound[..sound.len() - 20]] {
        let error = refused(bytes).to_string();
        assert!(error.contains("WebAssembly") || error.contains("__heap_base"), "{error}");
    }
}

#[test]
fn every_byte_of_a_module_may_be_wrong() {
    let body = [&[0x20, 0, 0x04, 0x40][..], &constant(5), &[0x21, 1, 0x0b, 0x20, 1]].concat();
    let function = Function { locals: 1, ..Function::new("f", &[I32], &[I32], &body) };
    let sound = module(&[function], 64, None);
    translate(&sound, "", "", &Documentation::default()).unwrap();
    for at in 0..sound.len() {
        for byte in [0, 1, 0x0b, 0x20, 0x41, 0x7f, 0xff] {
            let mut other = sound.clone();
            other[at] = byte;
            drop(translate(&other, "", "", &Documentation::default()));
            drop(stack(&other));
        }
    }
}

#[test]
fn an_import_recursion_and_double_precision_are_named() {
    let function = || Function::new("f", &[], &[], &[]);
    assert_eq!(refused(&module(&[function()], 64, Some("panic"))), Error::Import("panic()".to_owned()));
    assert_eq!(refused_body(&[], &[], &[0x10, 0]), Error::Recursion("function_0".to_owned()));
    assert!(refused_body(&[F64], &[], &[]).to_string().contains("single precision"));
    let widened = refused_body(&[F32], &[F32], &[0x20, 0, 0xbb, 0xb6]);
    assert_eq!(widened.to_string(), "function_0: F64PromoteF32 is not translated");
    let grown = refused_body(&[], &[I32], &[&constant(1)[..], &[0x40, 0]].concat());
    assert_eq!(grown.to_string(), "function_0: MemoryGrow is not translated");
    // There is no table to call by.
    assert!(refused_body(&[], &[], &[0x11, 0, 0]).to_string().contains("table"));
}

/// A function of the prelude is not one of the module.
#[test]
fn a_name_of_the_files_around_is_not_taken_again() {
    let before = "static int f_g(void);";
    let function = Function::new("f", &[], &[I32], &constant(3));
    let text = translate(&module(&[function], 64, None), before, "int inner_f_2;", &Documentation::default()).unwrap();
    assert!(text.contains("static uint32_t inner_f(void)\n"), "{text}");
}

#[test]
fn a_use_of_the_stack_pointer_that_hides_its_size_is_refused() {
    let body = |instructions: &[&[u8]]| Function { locals: 1, ..Function::new("f", &[], &[], &instructions.concat()) };
    let (get, set, keep, tee) = (&[0x23, 0][..], &[0x24, 0][..], &[0x21, 0][..], &[0x22, 0][..]);
    let (sub, add, and, drop) = (&[0x6b][..], &[0x6a][..], &[0x71][..], &[0x1a][..]);
    let number = constant;
    for hidden in [
        body(&[get, &number(-4096), add, tee, set]),
        body(&[get, &number(100), sub, &number(-64), and, tee, set]),
        body(&[get, &number(16), sub, tee, set, get, &number(4096), sub, set]),
        body(&[get, keep, &[0x20, 0], &number(-4096), add, drop]),
        body(&[get, &number(16), sub, tee, set, &[0x20, 0], &number(32), add, set]),
        body(&[&number(64), set]),
    ] {
        assert_eq!(refused(&module(&[hidden], 65536, None)), Error::StackPointer("function_0".to_owned()));
    }
    // One that calls nothing and leaves the stack pointer as it is.
    let leaf = body(&[get, keep, &[0x20, 0], &number(4096), sub, tee, drop]);
    assert_eq!(stack(&module(&[leaf], 65536, None)).unwrap().exported, [("f".to_owned(), 4096)]);
}

/// `f` takes 4096 bytes of the stack and calls `g`, which takes 32.
#[test]
fn the_stack_of_the_calls_is_known() {
    let taking = |bytes: i32, then: &[u8]| {
        [
            &[0x23, 0][..],
            &constant(bytes),
            &[0x6b, 0x22, 0, 0x24, 0],
            then,
            &[0x20, 0],
            &constant(bytes),
            &[0x6a, 0x24, 0],
        ]
        .concat()
    };
    let function = |name, body: Vec<u8>| Function { locals: 1, ..Function::new(name, &[], &[], &body) };
    let functions = || [function("f", taking(4096, &[0x10, 1])), function("g", taking(32, &[]))];
    let needed = stack(&module(&functions(), 65536, None)).unwrap();
    assert_eq!(needed.exported, [("f".to_owned(), 4128), ("g".to_owned(), 32)]);
    assert_eq!(needed.linked, 4144);
    assert_eq!(refused(&module(&functions(), 4128, None)), Error::Stack { needed: 4144, linked: 4128 });
    let text = translate(&module(&functions(), 4144, None), "", "", &Documentation::default()).unwrap();
    assert!(text.contains("#define STACK_BYTES 4144u\n#define HEAP 4160u"), "{text}");
}
