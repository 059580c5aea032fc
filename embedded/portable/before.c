/* The gearbox filter of wetclutch in C99, for compilers that Rust has no target for: the functions of wetclutch.h.
 *
 * Made by embedded/portable/build from the Rust sources, by way of WebAssembly: a change belongs there, not here. Each function has the name, the
 * documentation and the place of the Rust function that it is; what the compiler has put into its callers has none of its own.
 * u, w and f are whole numbers of 32 and 64 bits and numbers of single precision. Addresses are places in the memory m that the caller gives:
 * stack, constants, what is passed, and the observer.
 *
 * Nothing is allocated, no static variable is written, no function calls itself, and there is no double precision.
 */
/* Version of the images of parameters that it takes. */
#define IMAGE_VERSION @IMAGE_VERSION@u

#include <stddef.h>
#include <stdint.h>

#include "wetclutch.h"
