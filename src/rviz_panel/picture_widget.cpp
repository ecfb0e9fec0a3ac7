// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "rviz_panel/picture_widget.h"

#include <QtGui/QMouseEvent>
#include <QtGui/QPainter>
#include <opencv2/imgproc.hpp>

#include <algorithm>

namespace view_servo
{
PictureWidget::PictureWidget(QWidget* parent) : QWidget(parent)
{
  setMinimumSize(160, 120);
}

void PictureWidget::setPicture(const cv::Mat& picture, bool pickable)
{
  image_ = QImage();
  pickable_ = pickable && !picture.empty();
  if (!picture.empty())
  {
    cv::Mat rgb;
    cv::cvtColor(picture, rgb, cv::COLOR_BGR2RGB);
    image_ = QImage(rgb.data, rgb.cols, rgb.rows, static_cast<int>(rgb.step), QImage::Format_RGB888).copy();
  }
  if (pickable_)
  {
    picker_.setImageSize(picture.size());
  }
  setCursor(pickable_ ? Qt::CrossCursor : Qt::ArrowCursor);
  update();
}

void PictureWidget::setText(const QString& text)
{
  text_ = text;
  update();
}

QRectF PictureWidget::place() const
{
  const double scale =
      std::min(static_cast<double>(width()) / image_.width(), static_cast<double>(height()) / image_.height());
  const QSizeF size(scale * image_.width(), scale * image_.height());
  return { 0.5 * (width() - size.width()), 0.5 * (height() - size.height()), size.width(), size.height() };
}

void PictureWidget::paintEvent(QPaintEvent* /*event*/)
{
  QPainter painter(this);
  painter.fillRect(rect(), QColor(32, 32, 32));
  if (image_.isNull())
  {
    painter.setPen(QColor(200, 200, 200));
    painter.drawText(rect().adjusted(8, 8, -8, -8), Qt::AlignCenter | Qt::TextWordWrap, text_);
    return;
  }
  const QRectF frame = place();
  painter.setRenderHint(QPainter::SmoothPixmapTransform);
  painter.drawImage(frame, image_);
  const cv::Rect region = picker_.region();
  if (pickable_ && !region.empty())
  {
    const double scale = frame.width() / image_.width();
    const QRectF marked(frame.x() + scale * region.x, frame.y() + scale * region.y, scale * region.width,
                        scale * region.height);
    painter.setPen(QPen(Qt::black, 3));
    painter.drawRect(marked);
    painter.setPen(QPen(QColor(120, 255, 120), 1));
    painter.drawRect(marked);
  }
}

cv::Point PictureWidget::toPicker(const QPoint& position) const
{
  const QRectF frame = place();
  const double scale = picker_.scale() * image_.width() / frame.width();
  return { cvRound((position.x() - frame.x()) * scale), cvRound((position.y() - frame.y()) * scale) };
}

void PictureWidget::mousePressEvent(QMouseEvent* event)
{
  if (pickable_ && event->button() == Qt::LeftButton)
  {
    picker_.press(toPicker(event->pos()));
    update();
  }
}

void PictureWidget::mouseMoveEvent(QMouseEvent* event)
{
  if (pickable_ && picker_.isDragged())
  {
    picker_.move(toPicker(event->pos()));
    update();
  }
}

void PictureWidget::mouseReleaseEvent(QMouseEvent* event)
{
  if (pickable_ && picker_.isDragged() && event->button() == Qt::LeftButton)
  {
    picker_.release(toPicker(event->pos()));
    update();
    if (on_region)
    {
      on_region();
    }
  }
}

}  // namespace view_servo
