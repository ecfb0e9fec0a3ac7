// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tools/region_picker.h"

#include <QtGui/QImage>
#include <QtWidgets/QWidget>
#include <opencv2/core/mat.hpp>

#include <functional>

namespace view_servo
{
/** Shows a picture as large as fits, on a dark ground; a region can be dragged on it. */
class PictureWidget : public QWidget
{
public:
  explicit PictureWidget(QWidget* parent = nullptr);

  /** @param picture 8-bit BGR; empty: none. @param pickable whether a region can be dragged on it. */
  void setPicture(const cv::Mat& picture, bool pickable);

  /** Sets the text that is shown where there is no picture. */
  void setText(const QString& text);

  /** The region that was dragged [px of the picture]; empty: everywhere. It is kept while other pictures are shown. */
  cv::Rect region() const
  {
    return picker_.region();
  }

  /** Called when the mouse's button goes up on a picture that is pickable. */
  std::function<void()> on_region;

protected:
  void paintEvent(QPaintEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void mouseReleaseEvent(QMouseEvent* event) override;

private:
  /** Where the picture is in the widget [px of the widget]. */
  QRectF place() const;
  /** A position in the widget as RegionPicker takes it. */
  cv::Point toPicker(const QPoint& position) const;

  QImage image_;
  QString text_;
  bool pickable_ = false;
  RegionPicker picker_;
};

}  // namespace view_servo
