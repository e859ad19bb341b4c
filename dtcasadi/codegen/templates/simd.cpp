/* @maker@: functions of @name@ for many robots, declared in @name@_batch.h. Graph @graph@ */
#include "@name@_batch.h"

@lanes@
#define casadi_real dtc_lanes
#define @NAME@_CXX_LINKAGE
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#include "@name@_core.c"
#pragma GCC diagnostic pop

@batch@
@functions@
