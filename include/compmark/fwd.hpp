// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Forward declarations, for headers of embedding programs that only name our types. Templates with default arguments or
// constraints are not here: they are declared once, in their own headers.
#pragma once

#include <cstddef>

namespace compmark {

// core
template <class T>
struct MatrixView;
template <class T>
struct ImageView;
template <class T>
class Buffer;
template <class T>
struct GaussianColumns;
template <class T>
class GaussianBatch;
template <class T>
class ParameterArena;
class ArenaLayout;
struct BlockHandle;
struct RowEdit;
class Random;
struct SerialExecutor;
class ThreadExecutor;
class TbbExecutor;
class OpenMpExecutor;
struct Error;
struct Done;
template <class T>
class Result;

// scene, anchor
template <class T>
struct Camera;
struct Dataset;
template <class T>
struct AnchorColumns;
struct AnchorHandles;
struct DecoderShape;

// raster
struct Accuracy;
struct RasterOutputs;
template <class T>
struct Splat;
template <class T>
struct ScreenStatistics;
struct RasterReport;

}  // namespace compmark
