/* @maker@: calls @name@_@first@ once. */
#include <stdio.h>

#include "@name@.h"

static void show(const char *port, const @name@_real *values, int size) {
  int i;
  printf("%s:", port);
  for (i = 0; i < size; ++i) printf(" %g", (double)values[i]);
  printf("\n");
}

int main(void) {
  static @name@_work work;
@arrays@
  @name@_status status;
  int i;
@fill@
  status = @name@_@first@(&work, sizeof work@arguments@);
  if (status != @NAME@_OK) {
    fprintf(stderr, "@first@: %s\n", @name@_status_text(status));
    return 1;
  }
@show@
  return 0;
}
