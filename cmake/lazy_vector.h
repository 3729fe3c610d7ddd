#pragma once

// Makes the standard library's vector as C++17 has it, for clang (preset tidy) and nothing that
// runs.
//
// LibTorch 1.13 declares a vector of a type that is incomplete there. As C++20 has vector's members
// constexpr, clang instantiates them at once and refuses that; g++ does not. stl_bvector.h defines
// a function that was declared constexpr before: under another name it is one of its own.

#include <memory>
#include <string>

#pragma push_macro("_GLIBCXX20_CONSTEXPR")
#undef _GLIBCXX20_CONSTEXPR
#define _GLIBCXX20_CONSTEXPR
#define __fill_a1 __fill_bits
#include <vector>  // IWYU pragma: keep
#undef __fill_a1
#pragma pop_macro("_GLIBCXX20_CONSTEXPR")
