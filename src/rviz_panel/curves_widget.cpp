// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "rviz_panel/curves_widget.h"

#include <QtGui/QPainter>
#include <QtGui/QPainterPath>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

namespace view_servo
{
namespace
{
constexpr double SPAN = 60.0;  // [s]
constexpr double GAP = 1.0;    // samples further apart are not joined [s]

struct Curve
{
  double ErrorSample::*value;
  double scale;  // to the unit
  const char* unit;
  int decimals;
  QColor colour;
};

}  // namespace

CurvesWidget::CurvesWidget(QWidget* parent) : QWidget(parent)
{
  setFixedHeight(90);
}

void CurvesWidget::setErrors(const std::deque<ErrorSample>& errors)
{
  errors_ = errors;
  update();
}

void CurvesWidget::paintEvent(QPaintEvent* /*event*/)
{
  const std::array<Curve, 3> curves = {
    Curve{ &ErrorSample::translation, 1.0, "m", 3, QColor(255, 170, 60) },
    Curve{ &ErrorSample::rotation, 180.0 / M_PI, "deg", 2, QColor(110, 180, 255) },
    Curve{ &ErrorSample::points, 1.0, "px", 1, QColor(130, 235, 130) },
  };
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.fillRect(rect(), QColor(32, 32, 32));
  const QRectF area(5.0, 24.0, width() - 10.0, height() - 30.0);
  painter.setPen(QColor(70, 70, 70));
  painter.drawLine(area.bottomLeft(), area.bottomRight());
  int left = 6;
  const auto write = [&](const QString& text, const QColor& colour) {
    painter.setPen(colour);
    painter.drawText(left, 19, text);
    left += painter.fontMetrics().boundingRect(text).width() + 14;
  };
  write("to go:", QColor(190, 190, 190));
  const auto now = std::chrono::steady_clock::now();
  for (const Curve& curve : curves)
  {
    double largest = 0.0;
    double last = NAN;
    for (const ErrorSample& sample : errors_)
    {
      if (std::isfinite(sample.*curve.value))
      {
        last = sample.*curve.value;
        largest = std::max(largest, last);
      }
    }
    if (std::isnan(last))
    {
      continue;
    }
    write(QString("%1 %2 (%3)")
              .arg(curve.scale * last, 0, 'f', curve.decimals)
              .arg(curve.unit)
              .arg(curve.scale * largest, 0, 'f', curve.decimals),
          curve.colour);
    QPainterPath path;
    double drawn = SPAN + 2.0 * GAP;  // age of the sample before [s]
    for (const ErrorSample& sample : errors_)
    {
      const double age = std::chrono::duration<double>(now - sample.time).count();
      if (!std::isfinite(sample.*curve.value) || age > SPAN)
      {
        continue;
      }
      const double part = largest > 0.0 ? sample.*curve.value / largest : 0.0;
      const QPointF point(area.right() - area.width() * age / SPAN, area.bottom() - area.height() * part);
      if (drawn - age > GAP)
      {
        path.moveTo(point);
      }
      else
      {
        path.lineTo(point);
      }
      drawn = age;
    }
    painter.setPen(QPen(curve.colour, 1.5));
    painter.drawPath(path);
  }
}

}  // namespace view_servo
