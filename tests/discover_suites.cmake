# Writes OUTPUT for ctest: a test for each suite of a program of GoogleTest, PREFIX and its name, with PROPERTIES. Those of FIRST, a list
# of names, are started before the others. A suite whose tests are all skipped counts as skipped.
#
#   cmake -D PROGRAM=... -D PREFIX=... -D "PROPERTIES=..." -D "FIRST=..." -D OUTPUT=... -P discover_suites.cmake
cmake_minimum_required(VERSION 3.21)
execute_process(COMMAND ${PROGRAM} --gtest_list_tests OUTPUT_FILE ${OUTPUT}.txt TIMEOUT 60 COMMAND_ERROR_IS_FATAL ANY)
file(STRINGS ${OUTPUT}.txt suites REGEX "^[A-Za-z0-9_/]+\\.")
list(TRANSFORM suites REPLACE "^([A-Za-z0-9_/]+)\\..*" "\\1")
foreach(suite ${FIRST})
  if(NOT suite IN_LIST suites)
    message(FATAL_ERROR "${PROGRAM} has no suite ${suite}; name others to be first")
  endif()
endforeach()
set(script "")
foreach(suite ${suites})
  set(cost "")
  if(suite IN_LIST FIRST)
    set(cost "COST 50")
  endif()
  string(APPEND script "add_test([==[${PREFIX}${suite}]==] [==[${PROGRAM}]==] [==[--gtest_filter=${suite}.*]==])
set_tests_properties([==[${PREFIX}${suite}]==] PROPERTIES ${PROPERTIES} ${cost}
  FAIL_REGULAR_EXPRESSION [==[Running 0 tests]==]
  SKIP_REGULAR_EXPRESSION [==[PASSED  \\] 0 tests\\.\n\\[  SKIPPED \\] [0-9]+ tests?, listed below:\n(\\[  SKIPPED \\] [^\n]*\n)+$]==])\n")
endforeach()
file(WRITE ${OUTPUT} "${script}")
