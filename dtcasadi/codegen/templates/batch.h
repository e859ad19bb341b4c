/* @maker@: @name@, @title@, for many robots in one call
 *
 * Built from @name@_simd.cpp, a C++17 source that computes 8 robots at a time with AVX-512, 4 with
 * AVX, 2 elsewhere; any number n of robots will do. Callable from C99 and C++.
 *
 * Arrays are laid out by entries: entry k of robot i of a port is at port[k * ld_port + i], the
 * entries of a matrix column by column. ld_port is at least n; where it is 0, an argument is the
 * same for all robots, entry k at port[k]. A result may take the place of an argument with the same
 * ld (x_next that of x). Robots differ in their states, commands and, by theta, in their numbers.
 *
 *   size_t bytes = @name@_@first@_batch_bytes();    then, with work of that size,
 *   @name@_status status = @name@_@first@_batch(work, bytes, n, ...);
 *
 * No function allocates memory or keeps state: calls with different work spaces may run at the same
 * time. @NAME@_NOT_FINITE: a result of some robot is; @NAME@_OVERLAP: ld of a result below n.
 * Graph @graph@ */
#ifndef @NAME@_BATCH_H
#define @NAME@_BATCH_H

#include "@name@.h"

#ifdef __cplusplus
extern "C" {
#endif

@functions@
#ifdef __cplusplus
}
#endif

#endif
