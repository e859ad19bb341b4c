/* @maker@: functions of @name@, written by CasADi's code generator. Graph @graph@
 *
 * The interface for people is @name@.h. Symbols: @name@_raw_<function> (CasADi's own calling
 * convention, which casadi.external loads), @name@_internal_*. */
#if defined(__cplusplus) && !defined(@NAME@_CXX_LINKAGE)
extern "C" {
#endif

@body@
#if defined(__cplusplus) && !defined(@NAME@_CXX_LINKAGE)
}
#endif
