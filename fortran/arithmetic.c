/* The test of api_arithmetic.f90 for the C compiler; its exit status is 77 if something is changed. */
#include <float.h>
#include <math.h>

int main(void)
{
  static volatile const double numbers[] = {5, 0, NAN, DBL_MIN};
  double five = numbers[0], zero = -numbers[1], nan = numbers[2], product = five * 0.1;
  product = product * 3.0;
  zero = zero + 0.0;
  int is_changed = product != 1.5 || five / 3.0 != 5.0 / 3.0 || copysign(1.0, zero) < 0.0 ||
                   nan == nan || !(0.5 * numbers[3] > 0.0);
  return is_changed ? 77 : 0;
}
