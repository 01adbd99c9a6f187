// Servo loops and simulations of the registered mechanisms, instantiated once.
#define PALPATE_CORE_SOURCE
#include "palpate/servo/compiled.hpp"
