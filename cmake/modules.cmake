# One library a folder: add_module(NAME DEPENDS module... PACKAGES target... [PROGRAM program]).
# Every *.cpp beside the CMakeLists.txt belongs to it, but *_test.cpp, which make one test program,
# and main.cpp, which makes the PROGRAM.
# tools/check_layers.py compares the includes with DEPENDS.

find_package(PkgConfig REQUIRED)
find_package(TBB REQUIRED)
find_package(fmt REQUIRED)
find_package(GTest REQUIRED)

add_library(pietra_options INTERFACE)
# Bytes of a model must not depend on the machine: no contraction of multiply-add, no fast-math.
target_compile_options(pietra_options INTERFACE -Wall -Wextra -Wconversion -Wno-sign-conversion
                                                -ffp-contract=off)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
    target_compile_options(pietra_options INTERFACE -Wno-restrict)  # false alarms of std::string
endif()
if(PIETRA_WERROR)
    target_compile_options(pietra_options INTERFACE -Werror)
endif()
if(PIETRA_SANITIZE)
    target_compile_options(pietra_options INTERFACE -fsanitize=${PIETRA_SANITIZE}
                                                    -fno-omit-frame-pointer)
    target_link_options(pietra_options INTERFACE -fsanitize=${PIETRA_SANITIZE})
endif()
if(PIETRA_FUZZ)
    target_compile_options(pietra_options INTERFACE -fsanitize=fuzzer-no-link,address,undefined)
    target_link_options(pietra_options INTERFACE -fsanitize=address,undefined)
endif()
target_include_directories(pietra_options INTERFACE ${CMAKE_SOURCE_DIR}/src)

function(add_module name)
    cmake_parse_arguments(M "" "PROGRAM" "DEPENDS;PACKAGES" ${ARGN})
    file(GLOB sources CONFIGURE_DEPENDS *.cpp)
    set(tests ${sources})
    list(FILTER sources EXCLUDE REGEX "(_test|/main)\\.cpp$")
    list(FILTER tests INCLUDE REGEX "_test\\.cpp$")
    list(TRANSFORM M_DEPENDS PREPEND pietra_)
    if(sources)
        add_library(pietra_${name} STATIC ${sources})
        set(scope PUBLIC)
    else()
        add_library(pietra_${name} INTERFACE)
        set(scope INTERFACE)
    endif()
    target_link_libraries(pietra_${name} ${scope} pietra_options ${M_DEPENDS} ${M_PACKAGES})
    if(M_PROGRAM)
        add_executable(${M_PROGRAM} main.cpp)
        target_link_libraries(${M_PROGRAM} PRIVATE pietra_${name})
    endif()
    if(tests)
        add_executable(${name}_test ${tests})
        target_link_libraries(${name}_test PRIVATE pietra_${name} GTest::gtest_main)
        add_test(NAME ${name} COMMAND ${name}_test)
        set_tests_properties(${name} PROPERTIES TIMEOUT 300)
    endif()
endfunction()
