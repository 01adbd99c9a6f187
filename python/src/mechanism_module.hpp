#pragma once

#include <nanobind/nanobind.h>

#include <cctype>
#include <string>

/// Return the Python class name of a mechanism: five_bar becomes FiveBar.
template <class Mechanism>
std::string class_name() {
  std::string out;
  bool capital = true;
  for (const char* c = Mechanism::name; *c != '\0'; ++c) {
    if (*c != '_') out += capital ? static_cast<char>(std::toupper(*c)) : *c;
    capital = *c == '_';
  }
  return out;
}

/// Bind the mechanisms of the registry and their parameter tables.
void bind_mechanisms(nanobind::module_& m);
