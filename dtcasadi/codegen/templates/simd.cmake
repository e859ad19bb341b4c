
# Many robots in one call: link @name@_simd and include "@name@_batch.h".
enable_language(CXX)
add_library(@name@_simd @name@_simd.cpp)
set_target_properties(@name@_simd PROPERTIES POSITION_INDEPENDENT_CODE ON
  CXX_STANDARD 17 CXX_STANDARD_REQUIRED ON CXX_EXTENSIONS OFF)
target_compile_options(@name@_simd PRIVATE @simd_options@)
target_link_libraries(@name@_simd PUBLIC @name@)
