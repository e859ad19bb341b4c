CXX ?= c++
CXXFLAGS ?= @simd_flags@
.PHONY: simd
simd: lib$(NAME)_simd.a
$(NAME)_simd.o: $(NAME)_simd.cpp $(NAME)_core.c $(NAME)_batch.h $(NAME).h
	$(CXX) $(CPPFLAGS) $(CXXFLAGS) -fPIC -c -o $@ $<
lib$(NAME)_simd.a: $(NAME)_simd.o
	$(AR) rcs $@ $(NAME)_simd.o
lib$(NAME)_simd.so: $(NAME)_simd.o
	$(CXX) $(LDFLAGS) -shared -o $@ $(NAME)_simd.o -lm
