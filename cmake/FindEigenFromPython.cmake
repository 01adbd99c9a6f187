# Eigen 3.4: the system's if there is one, else the copy that the Python package `cmeel-eigen` carries.
find_package(Eigen3 3.4 CONFIG QUIET)
if(NOT Eigen3_FOUND)
  find_package(Python 3.11 COMPONENTS Interpreter QUIET)
  if(Python_Interpreter_FOUND)
    execute_process(COMMAND "${Python_EXECUTABLE}" -m cmeel cmake OUTPUT_VARIABLE palpate_cmeel
                    OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    find_package(Eigen3 3.4 CONFIG QUIET PATHS ${palpate_cmeel} HINTS ${palpate_cmeel})
  endif()
endif()
if(NOT Eigen3_FOUND)
  message(FATAL_ERROR "Eigen 3.4 was not found: install libeigen3-dev, or `pip install cmeel-eigen` for the Python that CMake finds")
endif()
