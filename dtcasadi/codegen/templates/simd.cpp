/* @maker@: functions of @name@ for many robots, declared in @name@_batch.h. Graph @graph@ */
#include "@name@_batch.h"

@lanes@
#define casadi_real dtc_lanes
#define @NAME@_CXX_LINKAGE
#include "@name@_core.c"

@batch@
@functions@
